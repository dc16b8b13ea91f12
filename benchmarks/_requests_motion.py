"""Another goal while the robot moves: from a drawn instant of a fast movement to a drawn goal, at
rest or on another movement in its motion, in four cells of two robots.

The judges are Pinocchio with samples at 10 kHz (limits and torque), Coal (distances) and SciPy's
Hermite polynomials (no jump where the driven movement is left). The peer in J is the stop and go:
braking as the planner does, then a movement from rest; what is refused is held against it too.
Ruckig, where it is installed (`pip install ruckig`), says how long the same joints take without
torque, bodies and a common path: no answer may be shorter. Durations and percentiles of processor
time stand above the kind's line.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from _coal_model import Coal
from _requests_rows import NOT_ASKED, Row
from _second_opinion import SecondOpinion
from scipy.interpolate import BPoly

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner, RequestError
from ir_planner.regional.in_motion import MovingEnd, braking
from ir_planner.request import Context, Journal, Work
from ir_values.arrays import FloatArray

CELLS = ("open", "table_columns", "cnc_door", "kr6_bench")
MARGIN = 0.02  # m
OBJECTIVES = ("time", "time_and_energy")
MOVING_GOALS = 4  # every so many cases end in motion
_INSTANTS = 500
_ROUNDED = 1e-5  # m between two codes
_JUMPS = (1e-9, 1e-9, 1e-7)  # rad, rad/s, rad/s^2
_SHORTER = 1e-6  # relative: Ruckig's rounding


class _Judge:
    """Everything that is wrong with a movement, by code of others."""

    def __init__(self, planner: Planner) -> None:
        scene = planner.scene()
        loads = [capsule for load in scene.loads for capsule in load.capsules]
        self._limits = SecondOpinion(scene)
        self._coal = Coal(
            scene.collision, [*scene.cell.robot.capsules, *loads], scene.cell.bodies()
        )
        self._kept = scene.thresholds(MARGIN) - _ROUNDED

    def objections(
        self, before: JointTrajectory, at: float, after: JointTrajectory
    ) -> tuple[str, ...]:
        """Sentences; none where all is well."""
        wrong = []
        if self._limits.largest_share(after) > 1.0 + 1e-6:
            wrong.append("a limit is exceeded")
        q = after.sample(np.linspace(0.0, after.duration, _INSTANTS)).q
        if any((self._coal.distances(one) <= self._kept).any() for one in q):
            wrong.append("a pair is too near")
        left = _hermite(before)
        right = _hermite(after)
        jumps = [np.abs(right(0.0, nu=k) - left(at, nu=k)).max() for k in range(3)]
        if any(jump > most for jump, most in zip(jumps, _JUMPS, strict=True)):
            wrong.append("it jumps where the driven movement is left")
        return tuple(wrong)


def _hermite(trajectory: JointTrajectory) -> BPoly:
    values = [trajectory.positions, trajectory.velocities, trajectory.accelerations]
    return BPoly.from_derivatives(trajectory.times, np.stack(values, axis=1))


def _ruckig(planner: Planner, begin: FloatArray, end: FloatArray) -> float:
    """Seconds that Ruckig's joints take between two states (3, n); NOT_ASKED where it isn't
    installed or refuses them.
    """
    try:
        import ruckig
    except ImportError:
        return NOT_ASKED
    robot = planner.cell.robot
    asked = ruckig.InputParameter(robot.n)
    asked.current_position, asked.current_velocity, asked.current_acceleration = begin.tolist()
    asked.target_position, asked.target_velocity, asked.target_acceleration = end.tolist()
    asked.max_velocity = robot.velocity_max.tolist()
    asked.max_acceleration = robot.acceleration_max.tolist()
    asked.max_jerk = np.asarray(planner.scene().limits.jerk).tolist()
    found = ruckig.Trajectory(robot.n)
    answer = ruckig.Ruckig(robot.n).calculate(asked, found)
    return float(found.duration) if answer == ruckig.Result.Working else NOT_ASKED


def _stopping_first(
    planner: Planner, begin: FloatArray, goal: FloatArray, objective: str
) -> tuple[float, float]:
    """Seconds and J of braking and of the movement from rest; NOT_ASKED twice where one isn't
    certified.
    """
    scene = planner.scene()
    context = Context(scene, PlanOptions(), Journal(Work(1, 0.0, lambda: 0.0), 0))
    stop = braking(MovingEnd(*begin, "start", StatusCode.START_STATE_INVALID), context)
    if stop is None:
        return NOT_ASKED, NOT_ASKED
    try:
        again = planner.plan_regional(start=stop.positions[-1], goal=goal, objective=objective)
    except RequestError:
        return NOT_ASKED, NOT_ASKED
    whole = None if again.trajectory is None else stop.then(again.trajectory)
    if whole is None or planner.evaluate(stop, safety_distance=0.0).report.min_clearance < MARGIN:
        return NOT_ASKED, NOT_ASKED
    return whole.duration, _joules(planner, planner.evaluate(whole).report)


def _joules(planner: Planner, report: Any) -> float:
    value = planner.cell.robot.time_value * report.duration
    return float(report.energy - report.base_energy + value)


class _Cell:
    """The requests of one cell."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.planner = Planner(name)
        self.judge = _Judge(self.planner)

    def free(self, rng: np.random.Generator) -> FloatArray:
        """A free configuration (n,)."""
        robot = self.planner.cell.robot
        while True:
            q = rng.uniform(robot.position_min, robot.position_max)
            if self.planner.check_states(q[None]).valid[0]:
                return np.asarray(q)

    def movement(self, rng: np.random.Generator) -> JointTrajectory:
        """A fast one between two free configurations."""
        while True:
            plan = self.planner.plan_regional(
                start=self.free(rng), goal=self.free(rng), objective="time"
            )
            if plan.trajectory is not None:
                return plan.trajectory

    def states(self, movement: JointTrajectory, at: float) -> FloatArray:
        """q, qd, qdd (3, n) of a movement at a time."""
        return np.array([values[0] for values in movement.sample([at])[:3]])


def rows(count: int) -> Iterator[Row]:
    """So many cases, a cell after the other; figures of all of them at the end."""
    cells = [_Cell(name) for name in CELLS]
    seconds = []
    beside_stop = []
    beside_ruckig = []
    for case in range(count):
        rng = np.random.default_rng([case, 13])
        cell = cells[case % len(cells)]
        planner = cell.planner
        before = cell.movement(rng)
        at = round(before.duration * rng.uniform(0.05, 0.95), 9)
        begin = cell.states(before, at)
        objective = OBJECTIVES[int(rng.integers(len(OBJECTIVES)))]
        end = np.zeros((3, planner.cell.robot.n))
        if case % MOVING_GOALS == MOVING_GOALS - 1:
            other = cell.movement(rng)
            end = cell.states(other, round(other.duration * rng.uniform(0.2, 0.8), 9))
        else:
            end[0] = cell.free(rng)
        words = f"{cell.name}, {objective}, case {case}"
        began = time.process_time()
        try:
            plan = planner.plan_regional(
                start=begin[0],
                start_velocity=begin[1],
                start_acceleration=begin[2],
                goal=end[0],
                goal_velocity=end[1],
                goal_acceleration=end[2],
                objective=objective,
            )
            refused = "" if plan.trajectory is not None else plan.status.message.split(":")[0][:80]
        except RequestError as error:
            refused = str(error).split(":")[0][:80]
        took = time.process_time() - began
        seconds.append(took)
        lasting, joules = (
            (NOT_ASKED, NOT_ASKED)
            if end[1:].any()
            else _stopping_first(planner, begin, end[0], objective)
        )
        if refused:
            yield Row(words, refused, False, (), took, peer_only=bool(lasting > 0.0))
            continue
        wrong = list(cell.judge.objections(before, at, plan.trajectory))
        least = _ruckig(planner, begin, end)
        if least > 0.0:
            beside_ruckig.append(plan.report.duration / least)
        if plan.report.duration < least * (1.0 - _SHORTER):
            wrong.append("it is shorter than Ruckig's joints can be")
        if objective == "time" and lasting > 0.0:
            beside_stop.append(plan.report.duration / lasting)
        own = _joules(planner, plan.report)
        yield Row(words, "", plan.report.certified, tuple(wrong), took, own, joules)
    _print(seconds, beside_stop, beside_ruckig)


def _print(seconds: list[float], beside_stop: list[float], beside_ruckig: list[float]) -> None:
    spent = 1e3 * np.percentile(seconds, [50, 99])
    print(f"    processor time: {spent[0]:.0f} ms median, {spent[1]:.0f} ms p99")
    for words, ratios in (
        ("stopping first, objective time", beside_stop),
        ("Ruckig's joints alone", beside_ruckig),
    ):
        if ratios:
            low, middle, high = np.percentile(ratios, [0, 50, 100])
            print(
                f"    duration over {words}: {middle:.3f} median, {low:.3f} to {high:.3f} "
                f"({len(ratios)} cases)"
            )
