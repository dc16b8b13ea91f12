"""From a free path to the cheapest movement near it: a cubic B-spline descends on its control points and its
duration.

Path and pace are chosen together: the cost is the objective's, and what exceeds a bound of speed,
acceleration, jerk, torque or clearance is punished. The descent runs on a coarse spline first and on finer
ones then. What comes out is slowed until every limit holds exactly, and its clearance is proved; a pair that
comes too near gets more room and the descent goes on from there.
"""

from dataclasses import dataclass, replace

import numpy as np
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_kernels import SplineCost, SplineTerms
from ir_planner.checks import Evaluation, Violation, clearance_violation, evaluate_trajectory
from ir_planner.curves import UniformSpline, along_path, fewest_seconds
from ir_planner.errors import RequestError
from ir_planner.request import Work
from ir_planner.scene import PROOF_TOLERANCE, MotionLimits, PlanningScene, tcp_inside, torque_use
from ir_planner.timing import (
    DURATION_SLACK,
    ObjectiveWeights,
    TimedMovement,
    check_duration,
    distinct,
    objective_value,
    objective_weights,
    stretched,
    timed_movement,
    trajectory_value,
)

IntArray = NDArray[np.int32]
_SPACING = 0.1  # s between the knots of the coarsest spline
_FEWEST, _MOST = 12, 64  # control points of the coarsest spline
_SLOWER = 1.3  # than the path at full speed: where the descent starts
_STIFFNESS = 4.0  # of penalties, against the power that the objective is about
_FINEST_STIFFNESS = 40.0  # the same on the finest spline
_TORQUE_SHARES = (0.98, 0.95, 0.9)
_MARGIN = 1e-3  # m of clearance beyond S_m that the descent asks for
_SCALE = 1e-2  # m that lack count like a limit used twice
_REPAIRS = 5
_MORE_ROOM = 1e-3  # m more than what lacked
_REPAIR_EVALUATIONS = 40
_PACES = (0.98, 0.95, 0.9)  # room that the limits leave where the duration is wished, until they are kept
_ROUNDING = 1e-9  # relative
_STIFFER = 10.0  # penalties where the duration is wished: a second may be worth much more than usual
_ZONE_SAMPLES = 4  # per interval
_TORQUE_SAMPLES = 6  # per interval; the proof comes after
_FITS = 25
_WITHIN_REACH = 1.06  # of a wished duration: from there more effort may get to it
_EDGES_PER_INTERVAL = 0.25  # work of one evaluation, in certified edges


@dataclass(frozen=True)
class Effort:
    """Evaluations of the cost on the coarse spline, on the next finer one, and on the finest."""

    coarse: int
    middle: int
    fine: int


QUICK = Effort(50, 40, 30)
THOROUGH = Effort(300, 300, 300)


@dataclass(frozen=True, eq=False)
class Draft:
    """A spline on its way down: its level (0: coarse), cost, the room (R, Z) m that its pairs are to have,
    and the pace that its limits leave room for.
    """

    spline: UniformSpline
    level: int
    cost: float
    room: FloatArray
    pace: float = 1.0


@dataclass(frozen=True, eq=False)
class Refined:
    """A movement near the free path (M, n) that it came from, its limits and its clearance proved; value: of
    the objective.
    """

    path: FloatArray
    trajectory: JointTrajectory
    value: float
    evaluation: Evaluation | None = None


class Refinement:
    """Descents for one request: the scene, what counts, and which limits hold.

    measured: movements come with everything that is known about them, else they are only proved and compared.
    """

    def __init__(
        self,
        scene: PlanningScene,
        options: PlanOptions,
        work: Work,
        station: str = "",
        *,
        measured: bool = False,
    ) -> None:
        self.scene, self.options, self.work, self.station = scene, options, work, station
        self.measured = measured
        self.limits = scene.limits.scaled(options.velocity_scaling, options.acceleration_scaling)
        plain = scene.thresholds(options.safety_distance) - PROOF_TOLERANCE / 2
        rows = [plain]
        if station and scene.allowed(station).any():
            rows.append(scene.thresholds(options.safety_distance, station) - PROOF_TOLERANCE / 2)
        self._room = np.stack(rows)
        self.shortest = np.inf  # s, of movements that were tried for a wished duration

    def drafted(self, path: FloatArray, evaluations: int = QUICK.coarse) -> Draft:
        """The coarse spline from a free path (M, n), M >= 2, gone down a little: enough to compare ways."""
        least = fewest_seconds(path, self.limits.velocity, self.limits.acceleration)
        check_duration(least, self.options)
        count = int(np.clip(np.ceil(least / _SPACING), _FEWEST, _MOST))
        wished = self.options.duration
        start = along_path(path, count, wished if wished > 0.0 else _SLOWER * least)
        return self.continued(start, path, evaluations)

    def continued(self, spline: UniformSpline, path: FloatArray, evaluations: int) -> Draft:
        """A coarse spline of any origin, gone down from its own shape and pace; path (M, n): what it came
        from.
        """
        pace = _PACES[0] if self.options.duration > 0.0 else 1.0
        return self._descended(Draft(spline, 0, np.inf, self._room, pace), path, evaluations)

    def finished(self, draft: Draft, path: FloatArray, effort: Effort = QUICK) -> Refined | None:
        """The proved movement that a draft ends in; None where it can't be made one."""
        found = self._finished(draft, path, effort)
        if self.options.duration > 0.0:
            for pace in _PACES[1:]:
                if found is None:
                    slower = self._descended(replace(draft, pace=pace), path, effort.coarse)
                    found = self._finished(slower, path, effort)
            if found is None:
                return self._slowed_to_wish(path)
        return found

    def _slowed_to_wish(self, path: FloatArray) -> Refined | None:
        """The fastest movement near a path, at a wished duration that leaves no joules to choose."""
        hurry = replace(self.options, objective="time", duration=0.0)
        fastest = Refinement(self.scene, hurry, self.work, self.station)
        for effort in (QUICK, THOROUGH):
            found = fastest.finished(fastest.drafted(path, effort.coarse), path, effort)
            if found is None:
                continue
            self.shortest = min(self.shortest, found.trajectory.duration)
            if found.trajectory.duration <= self.options.duration * (1.0 + DURATION_SLACK):
                factor = max(self.options.duration / found.trajectory.duration, 1.0)
                trajectory = stretched(found.trajectory, factor)
                blocked = clearance_violation(
                    trajectory, self.scene, self.options.safety_distance, self.station
                )
                if blocked is None:
                    return Refined(path, trajectory, trajectory_value(trajectory, self.scene, self.options))
            if found.trajectory.duration > _WITHIN_REACH * self.options.duration:
                break
        return None

    def check_wish(self) -> None:
        """Raise RequestError where the wished duration is shorter than the fastest movement found."""
        if np.isfinite(self.shortest) and self.shortest > self.options.duration * (1.0 + DURATION_SLACK):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"duration is {self.options.duration:g} s: the shortest within the limits is "
                f"{self.shortest:.4g} s",
            )

    def _finished(self, draft: Draft, path: FloatArray, effort: Effort) -> Refined | None:
        for evaluations in (effort.middle, effort.fine)[draft.level :]:
            finer = replace(draft, spline=draft.spline.subdivided(), level=draft.level + 1)
            draft = self._descended(finer, path, evaluations)
        for _ in range(_REPAIRS + 1):
            found = self._certified(draft, path)
            if not isinstance(found, Violation):
                return found
            if found.what != "clearance" or found.pair is None:
                return None
            draft = self._descended(self._with_more_room(draft, found), path, _REPAIR_EVALUATIONS)
        return None

    def _descended(self, draft: Draft, path: FloatArray, evaluations: int) -> Draft:
        self.work.check()
        spline = draft.spline
        found = self._cost(draft, path).descend(
            spline.control,
            spline.interval,
            self._rows(spline),
            fixed_interval=self.options.duration > 0.0,
            evaluations=evaluations,
        )
        self.work.spend(int(np.ceil(found.evaluations * spline.intervals * _EDGES_PER_INTERVAL)))
        robot = self.scene.cell.robot
        # a spline stays within the range of its control points
        control = np.clip(found.control, robot.position_min, robot.position_max)
        return replace(draft, spline=UniformSpline(control, found.interval), cost=found.value)

    def _cost(self, draft: Draft, path: FloatArray) -> SplineCost:
        scene, robot = self.scene, self.scene.cell.robot
        weights: ObjectiveWeights = objective_weights(self.options, scene, path)
        stiffness = weights.power * (_FINEST_STIFFNESS if draft.level == 2 else _STIFFNESS)
        stiffness *= _STIFFER if self.options.duration > 0.0 else 1.0
        limits = self.limits.with_torque_share(_TORQUE_SHARES[0]).for_speed(draft.pace)
        terms = SplineTerms(
            limits.velocity,
            limits.acceleration,
            limits.jerk,
            robot.position_min,
            robot.position_max,
            weights.travel,
            draft.room,
            torque_share=limits.torque_share,
            energy_value=weights.energy,
            time_value=weights.time,
            capacity_energy=scene.dc_bus.capacity_energy,
            regeneration=scene.dc_bus.regeneration,
            clearance_margin=_MARGIN,
            clearance_scale=_SCALE,
            penalty=stiffness,
            clearance_penalty=stiffness,
        )
        return SplineCost(scene.collision, scene.dynamics, terms)

    def _rows(self, spline: UniformSpline) -> IntArray:
        """Which thresholds hold in each interval: the station's where the tcp stays in the zone."""
        if len(self._room) == 1:
            return np.zeros(spline.intervals, np.int32)
        q, _, _ = spline.samples(_ZONE_SAMPLES)
        inside = tcp_inside(q, self.scene, self.station, self.options.safety_distance)
        whole: BoolArray = np.asarray(inside.reshape(spline.intervals, -1).all(axis=1))
        until = np.append(whole[1:], whole[-1])  # the end of an interval is the beginning of the next
        return np.asarray(whole & until, np.int32)

    def _with_more_room(self, draft: Draft, found: Violation) -> Draft:
        assert found.pair is not None  # asked before
        names = (found.pair.body_a, found.pair.body_b)
        room = draft.room.copy()
        for z, pair in enumerate(self.scene.collision.pairs):
            if (pair.body_a, pair.body_b) == names:
                room[:, z] += max(found.excess, 0.0) + _MORE_ROOM
        return replace(draft, room=room)

    def _certified(self, draft: Draft, path: FloatArray) -> Refined | Violation | None:
        """The movement, or what is in its way; None where its torque does not suffice."""
        scene, options = self.scene, self.options
        for share in _TORQUE_SHARES:
            self.work.check()
            trajectory = self._slowed(draft.spline, self.limits.with_torque_share(share))
            if trajectory is None:
                return None
            if self.measured:
                known = evaluate_trajectory(trajectory, scene, options.safety_distance, self.station)
                violation = known.verification.violation
                if violation is None:
                    value = objective_value(known.report, options.objective, options.time_value)
                    return Refined(path, trajectory, value, known)
                if violation.what != "torque":
                    return violation
                continue
            blocked = clearance_violation(trajectory, scene, options.safety_distance, self.station)
            if blocked is not None:
                return blocked
            bounds = scene.dynamics.torque_bounds(*trajectory.coefficients())
            if np.max(bounds.upper) <= 1.0:
                return Refined(path, trajectory, trajectory_value(trajectory, scene, options))
        return None

    def _slowed(self, spline: UniformSpline, limits: MotionLimits) -> JointTrajectory | None:
        """The motion as it is sent, as fast as it is or as much slower as the limits ask for; None where that
        is not enough, or slower than the wished duration.
        """
        fitted = within_limits(spline, limits, self.scene)
        if fitted is not None:
            check_duration(fitted.duration, self.options)
        wished = self.options.duration
        if fitted is not None and wished > 0.0:
            fitted = fitted.lasting(wished) if fitted.duration <= wished * (1.0 + _ROUNDING) else None
        if fitted is None:
            return None
        return fitted.trajectory(self.scene.cell.robot.joint_names)


def within_limits(spline: UniformSpline, limits: MotionLimits, scene: PlanningScene) -> UniformSpline | None:
    """The same path at the same pace or slower, within the limits; torque at samples. None where no pace
    carries it.
    """
    for _ in range(_FITS):
        top = spline.extremes()
        torque = torque_use(scene.dynamics, *spline.samples(_TORQUE_SAMPLES)).max() / limits.torque_share
        use = max(
            float((top.velocity / limits.velocity).max()),
            float((top.acceleration / limits.acceleration).max()) ** (1 / 2),
            float((top.jerk / limits.jerk).max()) ** (1 / 3),
            float(torque) ** (1 / 2),
        )
        if use <= 1.0:
            return spline
        spline = UniformSpline(spline.control, spline.interval * use * 1.0005)
    return None


def movement_over(
    path: FloatArray, scene: PlanningScene, options: PlanOptions, work: Work, station: str = ""
) -> TimedMovement:
    """The movement over a free path (M, n): refined, or in straight steps where that isn't certified or the
    joints are to take their own time.

    Raises TimingError when a torque does not suffice, RequestError when the wished duration is too short.
    """
    path = distinct(path)
    if len(path) > 1 and options.timing == "synchronous":
        refinement = Refinement(scene, options, work, station, measured=True)
        found = refinement.finished(refinement.drafted(path), path)
        if found is not None:
            evaluation = found.evaluation or evaluate_trajectory(
                found.trajectory, scene, options.safety_distance, station
            )
            movement = TimedMovement(path, found.trajectory, evaluation)
            if movement.violation is None:
                return movement
        refinement.check_wish()
    return timed_movement(path, scene, options, work, station)
