"""Puts a simulation together from names: cell, load and backend."""

from __future__ import annotations

from dataclasses import replace

from ir_description import Cell, PowerData, load_cell
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.plant import (
    IDEAL,
    NOMINAL,
    Plant,
    carried,
    ideal_plant,
    make_backend,
    plant_named,
)
from ir_sim_driver.power import IdleTimes

CELL_TOOL = "cell"
"""Load text that means the tool of the cell."""


def make_simulation(
    cell: str | Cell = "demo",
    load: str = CELL_TOOL,
    backend: str = "pybullet",
    settings: SimulationSettings | None = None,
    data: PowerData | None = None,
    plant: str | Plant = NOMINAL,
) -> Simulation:
    """Simulation of a cell (a Cell, the name of a bundled one or a path) with a load text of its
    loads.

    plant: a Plant or a text that names one, see `plant_named`; the ideal backend has none but its
    own. Raises what ir_description raises for a cell, RequestRefusedError for a load, SettingsError
    for a plant, BackendError.
    """
    settings = settings or SimulationSettings()
    cell = load_cell(cell) if isinstance(cell, str) else cell
    if load == CELL_TOOL:
        load = "none" if cell.tool is None else cell.tool.name
    what = carried(cell, load)
    data = data or cell.robot.controller
    plant = plant_named(plant, cell.robot, data) if isinstance(plant, str) else plant
    if backend == IDEAL:
        plant = ideal_plant(cell.robot, data)
    if not data.has_table:  # no mode to rest in: the brakes stay open while the robot waits
        timers = IdleTimes(data.motors_to_brakes_in_program, data.motors_to_brakes_in_command)
        settings = replace(settings, idle=timers)
    robot = make_backend(backend, cell, settings.dt, settings.control, plant)
    return Simulation(cell, data, robot, what, settings, plant)
