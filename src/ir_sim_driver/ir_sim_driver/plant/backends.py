"""The backends that there are: a new one is a class that implements `Backend` and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ir_description import Cell
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.plant.backend import Backend
from ir_sim_driver.plant.control import ControlSettings
from ir_sim_driver.plant.ideal_backend import IdealBackend
from ir_sim_driver.plant.plant_parameters import Plant, nominal_plant
from ir_sim_driver.plant.pybullet_backend import PyBulletBackend


def _pybullet(cell: Cell, dt: float, control: ControlSettings, plant: Plant) -> Backend:
    return PyBulletBackend(plant, cell.robot, dt, cell.base_pose, control)


def _ideal(cell: Cell, dt: float, control: ControlSettings, plant: Plant) -> Backend:
    return IdealBackend(cell.robot, dt, cell.base_pose)


BACKENDS: Mapping[str, Callable[[Cell, float, ControlSettings, Plant], Backend]] = {
    "pybullet": _pybullet,
    "ideal": _ideal,
}


def make_backend(
    name: str, cell: Cell, dt: float, control: ControlSettings, plant: Plant | None = None
) -> Backend:
    """The named backend for the plant, or the nominal one, of the cell's robot, stepped by dt [s].

    Raises SettingsError, BackendError.
    """
    if name not in BACKENDS:
        raise SettingsError(f"backend is {name[:80]!r}: known are {', '.join(BACKENDS)}")
    return BACKENDS[name](
        cell, dt, control, plant or nominal_plant(cell.robot, cell.robot.controller)
    )
