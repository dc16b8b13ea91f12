"""Another cell for a running simulation, while its robot stands."""

from __future__ import annotations

from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import BackendError
from ir_sim_driver.notices import Level


def take_offered_cell(simulation: Simulation) -> None:
    """Take the cell that is offered, if any and if the robot stands: tcp, postures, and the load as
    the cell describes it.
    """
    surroundings = simulation.surroundings
    if surroundings.offered is None or not simulation.stands:
        return
    planned = surroundings.take()
    if planned is None:
        return
    simulation.cell = cell = planned.cell
    notices = simulation.notices
    simulation.tool.stand_at(cell.base_pose, cell.tcp)
    load, warning = surroundings.load_in(cell, simulation.load)
    if warning:
        notices.add(Level.WARN, warning)
    try:
        simulation.set_load(load)
    except BackendError as error:
        notices.add(
            Level.ERROR, f"load {load.text!r} of cell {cell.name!r} can't be carried: {error}"
        )
    simulation.cell_watch.stand_in(cell, simulation.load)
    surroundings.settle(planned)
    notices.add(Level.OK, f"the robot stands in cell {cell.name!r} now, hash {surroundings.hash}")
