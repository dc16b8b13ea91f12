"""`ir cell`: cell files begun and checked, bundled cells listed."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING

import numpy as np

from ir_cli.errors import CommandError, InputError, unknown_name
from ir_cli.output import (
    Columns,
    ProgressLine,
    Row,
    add_formats,
    number,
    print_csv,
    print_json,
    print_table,
    table,
    text,
)
from ir_cli.planning import add_cell
from ir_cli.robot_shapes import floor_below
from ir_description import (
    Cell,
    CellFileError,
    DescriptionFileError,
    Finding,
    RobotModel,
    UnknownNameError,
    bundled_cells,
    cell_file_errors,
    cell_file_line,
    check_cell,
    is_path,
    load_cell,
    robot_named,
)
from ir_kernels import Chain
from ir_values.files import inside
from ir_values.output_files import write_file

# A cell file to begin with, in the size of its robot.

TEXT = """\
# A cell to begin with: {robot} fetches at one table and puts down at another.
# Lengths in m, masses in kg, times in s; angles in degrees where a key ends in _deg.
# docs/cell_format.md has every key.
format: ir_cell/1
name: {name}
robot: {robot}
{base}home_deg: {home}    # machine home, A1 to A6
park_deg: {home}    # where the program begins
tool:    # what is always on the flange; its capsules enclose it, in the frame of the flange, x outwards
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
      - {{name: pick, pose: {{xyz: [0, 0, {work:g}], abc_deg: [0, 90, 0]}}, approach_distance: {out:g}}}
  - name: table_out
    pose: {{xyz: [{x:g}, -{y:g}, 0]}}
    bodies:
      - {{name: table_out_top, kind: box, size: [{edge:g}, {edge:g}, {height:g}], xyz: [0, 0, {middle:g}]}}
    stations:
      - {{name: place, pose: {{xyz: [0, 0, {work:g}], abc_deg: [0, 90, 0]}}, approach_distance: {out:g}}}
program:
  - {{station: pick, dwell: 0.5}}
  - {{station: place, dwell: 0.5}}
  - {{posture: home}}
  - {{pause: 30}}
"""  # noqa: E501


def write_cell(path: Path, robot: str) -> None:
    """Write the file, which must not be there yet, and say what is next. Raises InputError,
    CommandError.
    """
    if path.suffix not in (".yaml", ".yml"):
        raise InputError(f"{path}: the name of a cell file ends in .yaml")
    text = cell_text(path.stem, robot, _robot(path, robot))
    try:
        write_file(path, text, new=True)
    except FileExistsError:
        raise CommandError(f"{path} is there already: another name, or remove it first") from None
    except OSError as error:
        raise CommandError(f"{path} can't be written: {error.strerror}") from error
    sys.stdout.write(f"{path}: next: ir plan {path}\n")


def cell_text(name: str, robot: str, model: RobotModel) -> str:
    """The file: tables and tool in proportion to the arm."""
    reach = float(np.linalg.norm(model.joint_origin[1:, :3, 3], axis=1).sum())
    height = _cm(0.2 * reach)
    tool = _cm(0.08 * reach)
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
        far=round(0.75 * tool, 3),
        wide=round(0.4 * tool, 3),
        near=round(0.2 * tool, 3),
        radius=round(0.2 * tool, 3),
        x=_cm(0.45 * reach),
        y=_cm(0.3 * reach),
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


if TYPE_CHECKING:
    from ir_cli.cell_mending import Suggestion

STATIONS: Columns = {
    "station": ("station", text),
    "load": ("load", text),
    "reached": ("reached", text),
    "free": ("free", text),
    "clearance": ("clearance mm", number(1, 1e3)),
    "obstacle": ("obstructed by", text),
}


def add_check(check: argparse.ArgumentParser) -> None:
    """Arguments of `ir check`."""
    add_cell(check)
    check.add_argument(
        "--deep",
        action="store_true",
        help="also every configuration, lines in and out, and the program, with lines to paste",
    )
    add_formats(check, comma=False)
    check.set_defaults(run=run_check)


def add_new(new: argparse.ArgumentParser) -> None:
    """Arguments of `ir new`."""
    new.add_argument("file", metavar="FILE", help="the file to write: my_cell.yaml")
    new.add_argument(
        "--robot", default="kr210_r2700_extra", metavar="ROBOT", help="ir robot list, or a file"
    )
    new.set_defaults(run=run_new)


def add_list(listing: argparse.ArgumentParser) -> None:
    """Arguments of `ir cell list`."""
    add_formats(listing)
    listing.set_defaults(run=run_list)


def run_check(arguments: argparse.Namespace) -> int:
    """Print all errors of a file, else what is in it; exit code 1 where its program can't run."""
    cell = _readable(arguments.cell)
    if cell is None:
        return 1
    from ir_cli.station_access import stations_of
    from ir_planner.program import unknown_searches  # a planner, only for a cell that can be read
    from ir_planner.search import SEARCHES

    stations = stations_of(cell)
    suggestions, configurations = _deep(cell) if arguments.deep else ([], [])
    findings: list[Finding | Suggestion] = [
        *check_cell(cell),
        *unknown_searches(cell, cell.program, SEARCHES),
        *suggestions,
    ]
    if arguments.json:
        listed = {"findings": [asdict(f) for f in findings if isinstance(f, Finding)]}
        listed["suggestions"] = [asdict(s) for s in suggestions]
        print_json(
            {"cell": cell.name, "stations": stations, "configurations": configurations, **listed}
        )
    else:
        _print_cell(cell)
        if stations:
            print_table(stations, STATIONS)
        if configurations:
            from ir_cli.station_access import CONFIGURATIONS

            print_table(configurations, CONFIGURATIONS)
        for finding in findings:
            _print_finding(finding, arguments.cell)
    unreached = any(not row["free"] for row in stations)
    return 1 if unreached or any(each.severity == "error" for each in findings) else 0


def run_new(arguments: argparse.Namespace) -> int:
    """Write a cell file to begin with."""
    write_cell(Path(arguments.file), arguments.robot)
    return 0


def run_list(arguments: argparse.Namespace) -> int:
    """Print the bundled cells."""
    if not (arguments.json or arguments.csv):
        sys.stdout.write("\n".join(bundled_cells()) + "\n")
        return 0
    rows: list[Row] = [
        {
            "cell": name,
            "robot": (cell := load_cell(name)).robot.name,
            "machines": len(cell.equipment),
            "stations": len(cell.stations),
            "steps": len(cell.program),
        }
        for name in bundled_cells()
    ]
    if arguments.json:
        print_json({"cells": rows})
    else:
        print_csv(rows)
    return 0


def _readable(name: str) -> Cell | None:
    """The cell, or None when all errors of its file have been printed."""
    try:
        return load_cell(name)
    except UnknownNameError as error:
        raise InputError(unknown_name("cell", name[:80], error.known, "ir cell list")) from error
    except DescriptionFileError as error:
        found = (cell_file_errors(name) if is_path(name) else ()) or (error,)
        for each in found:
            sys.stderr.write(f"ir: {each}\n")
        count = len(found)
        sys.stderr.write(f"ir: {count} error{'s' if count > 1 else ''}\n")
        return None


def _print_cell(cell: Cell) -> None:
    rows = [
        [
            machine.name,
            str(machine.zone.kind).lower(),
            str(len(machine.bodies)),
            machine.state or "-",
        ]
        for machine in cell.equipment
    ]
    tool = cell.tool.name if cell.tool else "none"
    sys.stdout.write(
        f"cell {cell.name}: robot {cell.robot.name}, tool {tool}; {len(cell.program)} steps\n"
    )
    if rows:
        sys.stdout.write(table(["equipment", "zone", "bodies", "state"], rows) + "\n")


def _print_finding(finding: Finding | Suggestion, file: str) -> None:
    """One line, with the place in the file, and what to paste there."""
    line = cell_file_line(file, finding.subject) if is_path(file) else 0
    place = f"{file}:{line}: " if line else ""
    sys.stdout.write(f"{place}{finding.severity}: {finding.subject}: {finding.sentence}\n")
    if pasted := getattr(finding, "yaml", ""):
        sys.stdout.write(indent(pasted, "    ") + "\n")


def _deep(cell: Cell) -> tuple[list[Suggestion], list[Row]]:
    from ir_cli.cell_mending import suggestions_of
    from ir_cli.station_access import configurations_of

    with ProgressLine() as line:
        line.show("deep check", 0, len(cell.stations), 0.0)
        return list(suggestions_of(cell)), configurations_of(cell)
