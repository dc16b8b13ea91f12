"""Waiting postures: the movements to a posture and back that a pause there takes."""

from collections.abc import Callable, Sequence

import numpy as np

from ir_description import Cell
from ir_msgs_py.modes import TransitionTimes
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError, unknown_name
from ir_planner.program import PauseLengths, Standby, Trip, best_posture, lengths_of
from ir_planner.regional import MovementPlan
from ir_planner.request import POSTURES, Goal, parse_goal
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

POSTURES_MAX = 20  # two movements are planned for each
Plan = Callable[[FloatArray, Goal], MovementPlan]


def standby_at(
    pause: float | PauseLengths,
    q: FloatArray | None,
    postures: Sequence[str],
    scene: PlanningScene,
    transitions: TransitionTimes,
    plan: Plan,
) -> Standby:
    """How to spend a pause [s] at q (n,), None: machine home, or at one of the postures."""
    lengths = pause if isinstance(pause, PauseLengths) else lengths_of(pause)
    here = scene.cell.machine_home if q is None else q
    return best_posture(
        lengths, here, trips_to(postures, here, scene.cell, plan), scene, transitions
    )


def trips_to(postures: Sequence[str], here: FloatArray, cell: Cell, plan: Plan) -> tuple[Trip, ...]:
    """Trips from here (n,) to named postures and stations and back. plan: a movement from a start
    to a goal.

    Raises RequestError for too many, and for one that the cell does not name.
    """
    if len(postures) > POSTURES_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"postures has {len(postures)} names: at most {POSTURES_MAX} are planned",
        )
    known = (*(station.name for station in cell.stations), *POSTURES)
    for name in postures:
        if name not in known:
            raise unknown_name("posture", name, known)
    return tuple(_trip(name, here, cell, plan) for name in postures)


def _trip(name: str, here: FloatArray, cell: Cell, plan: Plan) -> Trip:
    goal = parse_goal(name, cell)
    if goal.configuration is not None and np.array_equal(goal.configuration, here):
        return Trip(name, here)
    there = plan(here, goal)
    if there.trajectory is None:
        return Trip(name, here, problem=there.status.message)
    q = there.trajectory.positions[-1]
    back = plan(q, Goal(configuration=here))
    if back.trajectory is None:
        return Trip(name, here, problem=back.status.message)
    return Trip(
        name, q, _cost(there.report), _cost(back.report), _ids(there.trajectory, back.trajectory)
    )


def _cost(report: TrajectoryReport) -> tuple[float, float]:
    return report.duration, report.energy


def _ids(there: JointTrajectory, back: JointTrajectory) -> tuple[str, str]:
    return there.trajectory_id, back.trajectory_id
