"""Puts a simulation together from names: cell, load and backend."""

from __future__ import annotations

from typing import Any

from ir_description import PowerData, load_cell, load_power_data, robot_urdf
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.plant.backend import Backend
from ir_sim_driver.plant.ideal_backend import IdealBackend
from ir_sim_driver.plant.loads import carried
from ir_sim_driver.plant.pybullet_backend import PyBulletBackend

BACKENDS = ("pybullet", "ideal")
CELL_TOOL = "cell"
"""Load text that means the tool of the cell."""


def make_backend(name: str, cell: Any, settings: SimulationSettings) -> Backend:
    """Return the named backend for the cell's robot. Raises SettingsError, BackendError."""
    if name == "pybullet":
        return PyBulletBackend(cell.robot, settings.dt, robot_urdf, cell.base_pose, settings.control)
    if name == "ideal":
        return IdealBackend(cell.robot, settings.dt, cell.base_pose)
    raise SettingsError(f"backend is {name[:80]!r}: known are {', '.join(BACKENDS)}")


def make_simulation(
    cell: str | Any = "demo",
    load: str = CELL_TOOL,
    backend: str = "pybullet",
    settings: SimulationSettings | None = None,
    data: PowerData | None = None,
) -> Simulation:
    """Simulation of a cell (a Cell, the name of a bundled one or a path) with a load text of its loads.

    Raises what ir_description raises for a cell, RequestRefusedError for a load, BackendError.
    """
    settings = settings or SimulationSettings()
    cell = load_cell(cell) if isinstance(cell, str) else cell
    if load == CELL_TOOL:
        load = "none" if cell.tool is None else cell.tool.name
    what = carried(cell, load)
    return Simulation(cell, data or load_power_data(), make_backend(backend, cell, settings), what, settings)
