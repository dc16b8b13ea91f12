"""Movements of cells with what the planner's model predicts for each, and how a plant drives
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from _cell_movements import CellMovement, movements_of, planner_in

from ir_description import Cell
from ir_planner import PlannerSettings
from ir_sim_driver import Simulation, TrajectoryGoal, make_simulation
from ir_sim_driver.motion import GoalOutcome
from ir_sim_driver.plant import Plant, carried

REST = 0.5  # s in which the loops settle
LONGEST_REST = 20.0  # s until what an axis gave back has been used up by holding


@dataclass(frozen=True, eq=False)
class Predicted:
    """A movement and its energy [J] at the mains by the planner's model, from rest."""

    movement: CellMovement
    energy: float


@cache
def predicted(cell_name: str, objective: str = "time_and_energy") -> tuple[Predicted, ...]:
    """Every movement of a cell: of its program, and of its tasks there and back."""
    planner = planner_in(cell_name, PlannerSettings())
    return tuple(
        Predicted(m, planner.evaluate(m.trajectory, safety_distance=0.0, load=m.load).report.energy)
        for m in movements_of(planner, objective)
    )


def all_predicted(cells: Sequence[str], objective: str = "time_and_energy") -> list[Predicted]:
    """The movements of these cells."""
    return [each for name in cells for each in predicted(name, objective)]


class Driven:
    """A plant in a cell that drives movements one by one, each from rest."""

    def __init__(self, cell: Cell, plant: str | Plant) -> None:
        self.simulation: Simulation = make_simulation(cell, plant=plant)

    def drive(self, movement: CellMovement) -> GoalOutcome:
        """Put the robot at the begin of the movement, let it settle, and drive."""
        simulation = self.simulation
        if simulation.stopped:
            simulation.recover()
        if movement.load != simulation.load.text:
            simulation.set_load(carried(simulation.cell, movement.load))
        start = np.array(movement.trajectory.positions[0])
        simulation.backend.reset(start)
        simulation.executor.hold(start)
        self._rest()
        simulation.execute(simulation.vet(TrajectoryGoal(movement.trajectory), 0), 0)
        while True:
            simulation.step()
            outcomes = simulation.take_outcomes()
            if outcomes:
                return outcomes[-1]

    def _rest(self) -> None:
        """Stand until the capacitor is empty."""
        mains = self.simulation.mains
        begun = self.simulation.time
        self.simulation.run(REST)
        mains.settle()
        while (
            mains.meter.reading().capacitor_energy > 0.0
            and self.simulation.time < begun + LONGEST_REST
        ):
            self.simulation.run(REST)
            mains.settle()


def plant_by_cell(every: Sequence[Predicted], plant: str | Plant) -> dict[str, Driven]:
    """The plant in each cell of these movements: a physics server each, tens of megabytes."""
    cells = {each.movement.cell.name: each.movement.cell for each in every}
    return {name: Driven(cell, plant) for name, cell in cells.items()}
