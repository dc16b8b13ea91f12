"""Which plant is simulated, by a text: `nominal`, `typical`, `typical:SEED`, or the path of a plant
file.
"""

from __future__ import annotations

import re
from dataclasses import replace

from ir_description import PowerData, RobotModel, is_path
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.plant.plant_file import read_plant
from ir_sim_driver.plant.plant_parameters import NOMINAL, Plant, nominal_plant
from ir_sim_driver.plant.typical import TYPICAL, typical_plant

IDEAL = "ideal"
_TYPICAL = re.compile(rf"{TYPICAL}(?::([0-9]{{1,18}}))?")


def plant_named(text: str, robot: RobotModel, data: PowerData) -> Plant:
    """The plant that a text names; `typical` is `typical:0`. Raises SettingsError,
    PlantFileError.
    """
    if text == NOMINAL:
        return nominal_plant(robot, data)
    drawn = _TYPICAL.fullmatch(text)
    if drawn:
        return typical_plant(robot, data, int(drawn[1] or 0))
    if is_path(text):
        return read_plant(text, robot, data)
    raise SettingsError(
        f"plant is {text[:80]!r}: known are {NOMINAL}, {TYPICAL}, {TYPICAL}:SEED and the path of "
        "a .yaml file"
    )


def ideal_plant(robot: RobotModel, data: PowerData) -> Plant:
    """What the ideal backend is: a robot without physics on the nominal circuit."""
    return replace(nominal_plant(robot, data), name=IDEAL)
