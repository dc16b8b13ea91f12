"""A cell file to begin with: tables and tool in proportion to an arm, placed so that the program
plans.
"""

from __future__ import annotations

import itertools
import math
import sys
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from ir_cli.errors import CommandError, InputError, unknown_name
from ir_cli.robot_shapes import floor_below
from ir_cli.station_access import stations_of
from ir_description import (
    Cell,
    CellFileError,
    DescriptionError,
    RobotModel,
    UnknownNameError,
    is_path,
)
from ir_description.files import read_cell
from ir_description.library import robot_named
from ir_kernels import Chain
from ir_planner import Planner, PlanOptions
from ir_values.files import inside
from ir_values.output_files import write_file

TEXT = """\
# A cell to begin with: {robot} fetches at one table and puts down at another.
# Lengths in m, masses in kg, times in s; angles in degrees where a key ends in _deg.
# docs/cell_format.md has every key.
format: ir_cell/1
name: {name}
robot: {robot}
{base}home_deg: {home}    # machine home, A1 to A6
park_deg: {home}    # where the program begins
tool:    # what is always on the flange; its capsules enclose it (before them a plate as wide as the flange), in the frame of the flange, x outwards
  name: gripper
  mass: {mass:g}
  com: [{half:g}, 0, 0]    # centre of mass
  inertia_box: [{tool:g}, {wide:g}, {wide:g}]    # edges of a box that weighs the same
  capsules:
    - {{name: gripper_body, p0: [{near:g}, 0, 0], p1: [{far:g}, 0, 0], radius: {radius:g}}}
tcp: {{xyz: [{tool:g}, 0, 0]}}    # the tool's working point; its x axis points at the work
equipment:
  - name: table_in
    pose: {{xyz: [{x:g}, {y:g}, 0]}}    # of the machine in the world; bodies and stations stand in it
    bodies:
      - {{name: table_in_top, kind: box, size: [{edge:g}, {edge:g}, {height:g}], xyz: [0, 0, {middle:g}]}}
    stations:
      - {{name: pick, pose: {{xyz: [0, 0, {work:g}], abc_deg: [{turn:g}, {slope:g}, 0]}}, approach_distance: {out:g}}}
  - name: table_out
    pose: {{xyz: [{x:g}, -{y:g}, 0]}}
    bodies:
      - {{name: table_out_top, kind: box, size: [{edge:g}, {edge:g}, {height:g}], xyz: [0, 0, {middle:g}]}}
    stations:
      - {{name: place, pose: {{xyz: [0, 0, {work:g}], abc_deg: [{back:g}, {slope:g}, 0]}}, approach_distance: {out:g}}}
program:
  - {{station: pick, dwell: 0.5}}
  - {{station: place, dwell: 0.5}}
  - {{posture: home}}
  - {{pause: 30}}
"""  # noqa: E501


@dataclass(frozen=True)
class Layout:
    """Where the tables stand and how large the tool is, as shares of the arm's reach.

    begin: from the flange to the tool's capsule; on arms whose wrist is as thick as it is long, a
    tool at the flange itself is nearer to the forearm than any safety distance. slope: by which
    share of a right angle the tool points down.
    """

    x: float = 0.45
    y: float = 0.3
    height: float = 0.2
    tool: float = 0.08
    radius: float = 0.016
    begin: float = 0.016
    slope: float = 1.0


USUAL = Layout()
_XS = (0.45, 0.38, 0.55, 0.3)
_YS = (0.3, 0.15)
_HEIGHTS = (0.2, 0.3, 0.1)
_TOOLS = ((0.08, 0.016, 0.016), (0.1, 0.012, 0.03), (0.15, 0.012, 0.05))
_SLOPES = (1.0, 0.6, 0.3)
_PLANNED = 4  # layouts whose stations are reached that are planned at most
_WORK = 20_000  # certified edges of such a plan: a program to begin with is an easy one


def layouts() -> list[Layout]:
    """The usual layout, then others, those first that differ from it least."""
    places = itertools.product(_XS, _YS, _HEIGHTS, _TOOLS, _SLOPES)
    found = [Layout(x, y, height, *tool, slope) for x, y, height, tool, slope in places]

    def apart(layout: Layout) -> float:
        return float(np.abs(np.subtract(astuple(layout), astuple(USUAL))).sum())

    return sorted(found, key=apart)


def write_cell(path: Path, robot: str) -> None:
    """Write the file, which must not be there yet, and say what is next. Raises InputError,
    CommandError.
    """
    if path.suffix not in (".yaml", ".yml"):
        raise InputError(f"{path}: the name of a cell file ends in .yaml")
    if path.exists():
        raise CommandError(f"{path} is there already: another name, or remove it first")
    model = _robot(path, robot)
    text, lacking = planned_text(path, robot, model)
    try:
        write_file(path, text, new=True)
    except FileExistsError:
        raise CommandError(f"{path} is there already: another name, or remove it first") from None
    except OSError as error:
        raise CommandError(f"{path} can't be written: {error.strerror}") from error
    if lacking:
        sys.stderr.write(
            f"ir: of {len(layouts())} layouts of tables and tool none was found that plans; in the "
            f"one that is written {lacking}\n"
        )
        sys.stdout.write(f"{path}: next: ir check {path} --deep\n")
    else:
        sys.stdout.write(f"{path}: next: ir plan {path}\n")


def planned_text(path: Path, robot: str, model: RobotModel) -> tuple[str, str]:
    """The text of the first layout whose program plans, and ""; else that of the usual layout, and
    what lacks there.
    """
    lacking = ""
    planned = 0
    for layout in layouts():
        text = cell_text(path.stem, robot, model, layout)
        try:
            cell = read_cell(text, str(path), lambda _: model, path.parent)
        except DescriptionError as error:
            lacking = lacking or str(error)
            continue
        why = _unreached(cell)
        if not why:
            planned += 1
            why = _unplanned(cell)
        if not why:
            return text, ""
        lacking = lacking or why
        if planned == _PLANNED:
            break
    return cell_text(path.stem, robot, model), lacking


def _unreached(cell: Cell) -> str:
    """Why a station is not reached, "" where all are."""
    return next((str(row["obstacle"]) for row in stations_of(cell) if not row["free"]), "")


def _unplanned(cell: Cell) -> str:
    """Why the program can't be planned, "" where it can."""
    planner = Planner(clock=lambda: 0.0)  # by counted work: the same layout on every machine
    planner.set_cell(cell)
    plan = planner.plan_program(options=PlanOptions(max_iterations=_WORK))
    return "" if plan.status.ok else plan.status.message


def cell_text(name: str, robot: str, model: RobotModel, layout: Layout = USUAL) -> str:
    """The file: tables and tool in proportion to the arm."""
    outwards = round(math.degrees(math.atan2(layout.y, layout.x)), 1)
    turn = 0.0 if layout.slope == 1.0 else outwards
    reach = float(np.linalg.norm(model.joint_origin[1:, :3, 3], axis=1).sum())
    height = _cm(layout.height * reach)
    tool = _cm(layout.tool * reach)
    foot = -floor_below(Chain(model), model.capsules)
    why = "a pedestal: capsules of the arm reach below its foot"
    edge = _cm(0.25 * reach)
    return TEXT.format(
        name="".join(c if c.isalnum() or c in "_.-" else "_" for c in name),
        robot=robot,
        base=f"base: {{xyz: [0, 0, {foot:g}]}}    # {why}\n" if foot else "",
        home=f"[{', '.join(f'{angle + 0.0:g}' for angle in np.round(np.degrees(model.machine_home), 3))}]",  # noqa: E501
        mass=round(0.2 * model.rated_payload, 1),
        tool=tool,
        half=round(0.5 * tool, 3),
        far=round(tool - 1.25 * layout.radius * reach, 3),
        wide=round(2.0 * layout.radius * reach, 3),
        near=round(layout.begin * reach, 3),
        radius=round(layout.radius * reach, 3),
        turn=turn,
        back=0.0 - turn,
        slope=90.0 * layout.slope,
        x=_cm(layout.x * reach),
        y=_cm(layout.y * reach),
        edge=edge,
        height=height,
        middle=round(0.5 * height, 3),
        work=round(height + 0.06, 3),
        out=max(_cm(0.06 * reach), 0.05),
    )


def _robot(path: Path, robot: str) -> RobotModel:
    """The robot as the cell file names it: a bundled one, or a file beside the cell file."""
    try:
        return robot_named(str(inside(path.parent, robot)) if is_path(robot) else robot)
    except UnknownNameError as error:
        raise InputError(unknown_name("robot", robot[:80], error.known, "ir robot list")) from error
    except CellFileError as error:
        raise InputError(str(error)) from error


def _cm(value: float) -> float:
    return round(value, 2)
