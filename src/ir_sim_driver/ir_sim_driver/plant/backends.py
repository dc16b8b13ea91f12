"""The backends that there are: a new one is a class that implements `Backend` and a line here, or
an entry point of an installed package (group `ir_sim_driver.backends`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ir_description import Cell
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.plant.backend import Backend
from ir_sim_driver.plant.ideal_backend import IdealBackend
from ir_sim_driver.plant.plant_parameters import Plant, nominal_plant
from ir_sim_driver.plant.pybullet_backend import PyBulletBackend
from ir_sim_driver.plant.servo_control import ControlSettings
from ir_values.errors import DescriptionError, InvalidValueError
from ir_values.extensions import Registry


def _pybullet(cell: Cell, dt: float, control: ControlSettings, plant: Plant) -> Backend:
    return PyBulletBackend(plant, cell.robot, dt, cell.base_pose, control)


def _ideal(cell: Cell, dt: float, control: ControlSettings, plant: Plant) -> Backend:
    return IdealBackend(cell.robot, dt, cell.base_pose)


MakeBackend = Callable[[Cell, float, ControlSettings, Plant], Backend]


def _made(name: str, value: Any) -> MakeBackend:
    """The function of an entry point, of cell, step [s], control settings and plant."""
    if not callable(value):
        raise InvalidValueError("must be a function of cell, step, control settings and plant")
    make: MakeBackend = value
    return make


BACKENDS: Registry[MakeBackend] = Registry(
    "ir_sim_driver.backends", {"pybullet": _pybullet, "ideal": _ideal}, _made
)


def make_backend(
    name: str, cell: Cell, dt: float, control: ControlSettings, plant: Plant | None = None
) -> Backend:
    """The named backend for the plant, or the nominal one, of the cell's robot, stepped by dt [s].

    Raises SettingsError, BackendError.
    """
    if name not in BACKENDS:
        raise SettingsError(f"backend is {name[:80]!r}: known are {', '.join(BACKENDS)}")
    try:
        make = BACKENDS[name]
    except DescriptionError as error:
        raise SettingsError(f"backend: {error}") from error
    return make(cell, dt, control, plant or nominal_plant(cell.robot, cell.robot.controller))
