"""Cell files of a recording, so that it can be read on its own: the cell, its URDF, and the data of
the robot and its controller that the cell refers to by name.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

from ir_description import (
    DescriptionError,
    cell_from_yaml,
    cell_to_yaml,
    load_cell,
    load_robot_cells,
    robot_urdf,
)
from ir_description.library import robot_in
from ir_recorder.errors import RecorderError
from ir_recorder.format import contents
from ir_values.errors import InvalidValueError


@dataclass(frozen=True)
class CellFiles:
    """The cell in its own file format, and the robot's URDF; namespace: of one of several robots,
    whose attachments are in a folder of its name.
    """

    cell_yaml: str
    urdf: str
    namespace: str = ""


def data_of_cell(cell_yaml: str) -> dict[str, str]:
    """Texts by attachment; empty for a text that is no cell."""
    try:
        robot = cell_from_yaml(cell_yaml, "the attached cell").robot
    except (DescriptionError, InvalidValueError):
        return {}
    data = files("ir_description") / "data"
    if robot.document:  # the cell's text has it, its controller included
        return {contents.ROBOT: robot.document}
    found = {contents.ROBOT: data / "robots" / f"{robot.name}.yaml"}
    found[contents.POWER] = data / "power" / f"{robot.controller.name}.yaml"
    return {
        name: path.read_text(encoding="utf-8") for name, path in found.items() if path.is_file()
    }


def files_of_cell(name_or_path: str) -> tuple[CellFiles, ...]:
    """Files of a bundled cell or of one on disk, of each robot where it has several.

    Raises RecorderError when there is none or it is broken.
    """
    try:
        named = robot_in(name_or_path)[1]
        several = None if named else load_robot_cells(name_or_path)
        cells = {"": load_cell(name_or_path)} if several is None else several.by_name
    except DescriptionError as error:
        raise RecorderError(f"cell {name_or_path[:200]!r} can't be attached: {error}") from error
    return tuple(
        CellFiles(
            cell_to_yaml(cell), robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose), robot
        )
        for robot, cell in cells.items()
    )
