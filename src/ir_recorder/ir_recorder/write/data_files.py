"""Data that a cell refers to by name, as a recording carries them: the robot's and its controller's
files.
"""

from __future__ import annotations

from importlib.resources import files

from ir_description import DescriptionError, cell_from_yaml
from ir_msgs_py.errors import InvalidValueError
from ir_recorder.format import contents


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
