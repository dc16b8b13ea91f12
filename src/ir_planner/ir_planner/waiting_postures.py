"""Waiting postures: at which of some postures a pause costs least, moving there and back included.

The movement there is the beginning of the pause. Of a pause of known length the movement back is
its end; where the end is not known, the robot is woken at the end and ready when it is back.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ir_description import Cell
from ir_msgs_py.modes import TransitionTimes
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError, unknown_name
from ir_planner.program import PauseLengths, Standby, lengths_of, plan_standby
from ir_planner.regional import MovementPlan
from ir_planner.request import POSTURES, Goal, parse_goal
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

POSTURES_MAX = 20  # two movements are planned for each
Plan = Callable[[FloatArray, Goal], MovementPlan]


class Trip(NamedTuple):
    """To a posture q (n,) and back.

    there, back: seconds and joules at the mains of both movements.
    ids: of their trajectories, "" where the robot stands there already.
    problem: why it isn't possible, "" where it is.
    """

    posture: str
    q: FloatArray
    there: tuple[float, float] = (0.0, 0.0)
    back: tuple[float, float] = (0.0, 0.0)
    ids: tuple[str, str] = ("", "")
    problem: str = ""

    @property
    def joules(self) -> float:
        """Energy [J] of both movements."""
        return self.there[1] + self.back[1]

    @property
    def sentence(self) -> str:
        """What the trip takes."""
        if self.problem:
            return f"{self.posture} is out of the question: {self.problem}"
        both = (("there", self.there, self.ids[0]), ("back", self.back, self.ids[1]))
        return f"{self.posture}: " + ", ".join(
            f"{joules:.0f} J in {seconds:.2f} s {where}" + (f" ({name})" if name else "")
            for where, (seconds, joules), name in both
        )


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


def best_posture(
    lengths: PauseLengths,
    q: FloatArray,
    trips: tuple[Trip, ...],
    scene: PlanningScene,
    times: TransitionTimes,
) -> Standby:
    """How to spend a pause of these lengths, and where: at q (n,), where the robot stands, or
    elsewhere.
    """
    here = plan_standby(lengths, q, scene, times)
    options = [_after(trip, here, lengths, scene, times) for trip in trips]
    energies = tuple(float("inf") if option is None else option.energy for option in options)
    best = min(
        (here, *(option for option in options if option is not None)), key=lambda each: each.energy
    )
    return replace(best, posture_energies=energies, trips=tuple(trip.sentence for trip in trips))


def _after(
    trip: Trip, here: Standby, lengths: PauseLengths, scene: PlanningScene, times: TransitionTimes
) -> Standby | None:
    """The advice with a trip; None where there is none, or not the time for it."""
    back = trip.back[0] if lengths.known else 0.0
    left = lengths.less(trip.there[0] + back)
    if trip.problem or left.most <= 0.0:
        return None
    there = plan_standby(left, trip.q, scene, times)
    late = 0.0 if lengths.known else trip.back[0]
    energy = there.energy + trip.joules
    return replace(
        there,
        energy=energy,
        expected=energy,
        worst=there.worst + trip.joules,
        clairvoyant=there.clairvoyant + trip.joules,
        saving=here.saving + here.energy - energy,
        saving_low=there.saving_low + here.saving + here.energy - energy - there.saving,
        saving_high=there.saving_high + here.saving + here.energy - energy - there.saving,
        saving_on_motors=here.saving_on_motors + here.energy - energy,
        wake_at=there.wake_at + trip.there[0],
        switch_times=tuple(at + trip.there[0] for at in there.switch_times),
        alternatives=here.alternatives,
        energies=here.energies,
        late=there.late + late,
        latest=there.latest + late,
        posture=trip.posture,
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
