"""`ir cell new`: a cell file to begin with, in the size of its robot."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from ir_description import CellFileError, RobotModel, UnknownNameError, is_path, robot_named
from ir_values.files import inside

from ..errors import CommandError, InputError
from ..suggestions import unknown_name

TEXT = """\
# A cell to begin with: {robot} fetches at one table and puts down at another.
# Lengths in m, masses in kg, times in s; angles in degrees where a key ends in _deg.
# docs/cell_format.md has every key.
format: ir_cell/1
name: {name}
robot: {robot}
home_deg: {home}    # machine home, A1 to A6
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
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
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
    edge = _cm(0.25 * reach)
    return TEXT.format(
        name="".join(c if c.isalnum() or c in "_.-" else "_" for c in name),
        robot=robot,
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
