"""The controller of a robot file: a bundled table, one in a file beside it, one written out, or
none.

Without a table: its watts while the motors are on and its DC link, as far as they are known.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from ir_description.errors import RobotFileError, UnknownNameError
from ir_description.files.confidence import marks_of
from ir_description.files.figures import figure
from ir_description.files.items import Item
from ir_description.files.mesh import read_regular_file
from ir_description.files.places import inside, is_path
from ir_description.files.power_file import dc_link, power_from_yaml, power_of
from ir_description.files.text_file import text_of
from ir_description.files.yaml_tree import Node, parse_yaml
from ir_description.robot import USUAL_LINK, PowerData, without_table
from ir_msgs_py.errors import InvalidValueError

_POWER = files("ir_description") / "data" / "power"
NONE = "none"
BYTES_MAX = 1_000_000


def bundled_controllers() -> tuple[str, ...]:
    """Names of the tables that come with the package."""
    names = (entry.name for entry in _POWER.iterdir())
    return tuple(sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml")))


@cache
def bundled_controller(name: str) -> PowerData:
    """The bundled table of that name; the same object for the same name."""
    if name not in bundled_controllers():
        raise UnknownNameError("controller", name, bundled_controllers())
    path = _POWER / f"{name}.yaml"
    return power_from_yaml(path.read_text(encoding="utf-8"), path.name)


def read_controller(item: Item, folder: Path | None) -> PowerData:
    """The power figures that a robot file names, or holds."""
    if not item.is_scalar():
        return power_of(item) if item.holds("format") else _without_table(item)
    name = item.text()
    if name == NONE:
        return without_table()
    with item.blamed():
        if not is_path(name):
            return bundled_controller(name)
        try:
            return power_from_yaml(_text(name, folder), name)
        except RobotFileError as error:
            raise InvalidValueError(str(error)) from error


def controller_document(item: Item, power: PowerData, folder: Path | None) -> Node:
    """What a robot file that needs no other file says of its controller."""
    if item.is_scalar() and is_path(item.text()):
        return parse_yaml(_text(item.text(), folder), power.name, RobotFileError)
    return item.node


def _text(name: str, folder: Path | None) -> str:
    return text_of(read_regular_file(inside(folder, name), BYTES_MAX), name, RobotFileError)


def _without_table(item: Item) -> PowerData:
    table = item.table((), ("standing_w", "dc_link"))
    watts = figure(table["standing_w"]).number(0, 1e5, "W") if "standing_w" in table else 0.0
    link = dc_link(table["dc_link"]) if "dc_link" in table else USUAL_LINK
    own = marks_of(item.node)
    marks = {"modes.STAND_ON_MOTORS.controller_w": own["standing_w"]} if "standing_w" in own else {}
    return without_table(watts, link, {**own, **marks})
