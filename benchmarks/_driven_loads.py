"""The stepped driver, with controller and encoders, carries a payload: what does its load check
find?
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ir_description import Cell
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import Simulation, SimulationSettings, make_simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.load_check import LoadCheckSettings, LoadFinding
from ir_sim_driver.motion import TrajectoryGoal
from ir_sim_driver.plant import Carried
from ir_values.arrays import FloatArray

SLOWER = (
    1.0,
    1.5,
    2.5,
)  # times the duration by the limits of speed and acceleration: torque may need it
SETTLING = 0.5  # s


class Carrier:
    """A plant in `cell` that carries `load`, and so much more of it than is declared."""

    def __init__(self, cell: Cell, plant: str, load: Carried, mass_error: float) -> None:
        settings = SimulationSettings(load_check=LoadCheckSettings(mass_error=mass_error))
        self.simulation: Simulation = make_simulation(cell, plant=plant, settings=settings)
        self.simulation.set_load(load)

    def weigh(self, between: Callable[[], tuple[FloatArray, FloatArray]]) -> LoadFinding:
        """What the first movement from rest to rest `between` two postures finds that may start."""
        while True:
            start, end = between()
            for slower in SLOWER:
                goal = self._goal(start, end, slower)
                try:
                    executed = self.simulation.vet(goal, 0)
                except TrajectoryRefusedError:  # it collides, or needs more torque than there is
                    continue
                self._stand(start)
                self.simulation.execute(executed, 0)
                while not (outcomes := self.simulation.take_outcomes()):
                    self.simulation.step()
                found = outcomes[-1].load_check
                if (
                    self.simulation.stopped
                ):  # more than the motors carry so fast: the supervision stopped it
                    self._recover()
                if found is not None:
                    return found

    def _goal(self, start: FloatArray, end: FloatArray, slower: float) -> TrajectoryGoal:
        robot = self.simulation.robot
        size = np.abs(end - start)
        rest = np.zeros((2, len(start)))
        fastest = (
            (1.9 * size / robot.velocity_max).max(),
            np.sqrt(6.0 * size / robot.acceleration_max).max(),
        )
        times = np.array([0.0, max(fastest) * slower])
        path = JointTrajectory.from_seconds(
            robot.joint_names, times, np.array([start, end]), rest, rest
        )
        return TrajectoryGoal(path)

    def _recover(self) -> None:
        self.simulation.run(SETTLING)
        self.simulation.recover()

    def _stand(self, q: FloatArray) -> None:
        self.simulation.backend.reset(q)
        self.simulation.executor.hold(q)
        self.simulation.run(SETTLING)
