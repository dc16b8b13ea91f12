"""Puts a simulation together from names: cell, load and backend."""

from __future__ import annotations

from ir_description import Cell, PowerData, load_cell, load_power_data
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.plant import carried, make_backend

CELL_TOOL = "cell"
"""Load text that means the tool of the cell."""


def make_simulation(
    cell: str | Cell = "demo",
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
    robot = make_backend(backend, cell, settings.dt, settings.control)
    return Simulation(cell, data or load_power_data(), robot, what, settings)
