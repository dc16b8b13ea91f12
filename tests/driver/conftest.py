"""A simulated cell that is stepped, with the ideal robot where physics doesn't matter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from ir_description import Cell, load_cell
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.controller.simulation import Simulation, make_simulation
from ir_sim_driver.motion.goal import GoalOutcome, TrajectoryGoal


@pytest.fixture(scope="session")
def cell() -> Cell:
    return load_cell("open")


@pytest.fixture(scope="session")
def make(cell: Cell) -> Callable[..., Simulation]:
    """A simulation: make(backend="ideal", load="cell", **stages of SimulationSettings)."""

    def make_one(backend: str = "ideal", load: str = "cell", **stages: Any) -> Simulation:
        return make_simulation(cell, load, backend, SimulationSettings(**stages))

    return make_one


@pytest.fixture(scope="session")
def plan(cell: Cell) -> Callable[..., JointTrajectory]:
    """Rest to rest through points: plan(2.0, q0, q1), or plan([0, 1, 2.5], q0, q1, q2)."""

    def plan_one(
        times: float | Sequence[float], *points: Any, velocities: bool = True
    ) -> JointTrajectory:
        stamps = (
            np.linspace(0.0, times, len(points)) if isinstance(times, float) else np.array(times)
        )
        rest = np.zeros((len(points), 6)) if velocities else None
        return JointTrajectory.from_seconds(
            cell.robot.joint_names, stamps, np.array(points), rest, rest
        )

    return plan_one


@pytest.fixture(scope="session")
def start() -> Callable[..., int]:
    """Vet and execute a trajectory; returns the goal's id."""

    def start_one(
        simulation: Simulation, trajectory: JointTrajectory, now_ns: int = 0, **more: Any
    ) -> int:
        return simulation.execute(
            simulation.vet(TrajectoryGoal(trajectory, **more), now_ns), now_ns
        )

    return start_one


@pytest.fixture(scope="session")
def run_out() -> Callable[..., GoalOutcome]:
    """Step until the goal has ended; returns its outcome."""

    def run(simulation: Simulation, limit: float = 60.0) -> GoalOutcome:
        for _ in range(round(limit / simulation.settings.dt)):
            simulation.step()
            outcomes = simulation.take_outcomes()
            if outcomes:
                return outcomes[-1]
        raise AssertionError(f"no goal ended within {limit:g} s of plant time")

    return run
