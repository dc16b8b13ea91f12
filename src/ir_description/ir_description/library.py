"""What this package carries with it, by name: robots, power data, cells."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from ir_description.errors import UnknownNameError
from ir_description.power import PowerData
from ir_description.power_file import power_from_yaml
from ir_description.robot import RobotModel
from ir_description.robot_file import robot_from_yaml

_DATA = files("ir_description") / "data"


def _bundled(folder: str) -> tuple[str, ...]:
    names = (entry.name for entry in (_DATA / folder).iterdir())
    return tuple(sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml")))


def bundled_robots() -> tuple[str, ...]:
    """Return the names that load_robot knows."""
    return _bundled("robots")


@cache
def load_robot(name: str = "kr210_r2700_extra") -> RobotModel:
    """Return a bundled robot; the same object for the same name."""
    if name not in bundled_robots():
        raise UnknownNameError("robot", name, bundled_robots())
    path = _DATA / "robots" / f"{name}.yaml"
    return robot_from_yaml(path.read_text(encoding="utf-8"), path.name)


@cache
def load_power_data(name: str = "kr_c4") -> PowerData:
    """Return the power figures of a bundled controller."""
    if name not in _bundled("power"):
        raise UnknownNameError("controller", name, _bundled("power"))
    path = _DATA / "power" / f"{name}.yaml"
    return power_from_yaml(path.read_text(encoding="utf-8"), path.name)
