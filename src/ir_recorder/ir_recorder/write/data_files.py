"""Data that a cell refers to by name, as a recording carries them: the robot's and its controller's files."""

from __future__ import annotations

from importlib.resources import files

from ir_description import DescriptionError, cell_from_yaml, load_power_data
from ir_msgs_py.errors import InvalidValueError
from ir_recorder.format import contents


def data_of_cell(cell_yaml: str) -> dict[str, str]:
    """Texts by attachment; empty for a text that is no cell."""
    try:
        robot = cell_from_yaml(cell_yaml, "the attached cell").robot.name
    except (DescriptionError, InvalidValueError):
        return {}
    data = files("ir_description") / "data"
    found = {contents.ROBOT: data / "robots" / f"{robot}.yaml"}
    found[contents.POWER] = data / "power" / f"{load_power_data().name}.yaml"
    return {name: path.read_text(encoding="utf-8") for name, path in found.items() if path.is_file()}
