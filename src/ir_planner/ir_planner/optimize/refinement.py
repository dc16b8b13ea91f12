"""From a free path to the cheapest movement near it: a cubic B-spline is optimised by its control
points and its duration.

Path and time scaling are chosen together: the cost is the objective's, and what exceeds a bound of
speed, acceleration, jerk, torque or clearance is penalised. The descent runs on a coarse spline
first and on finer ones then. The result is slowed until every limit holds exactly, and its
clearance is proved; a pair that comes too near gets a larger clearance margin, and the descent
continues.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ir_kernels import SplineCost
from ir_kernels.spline import RowArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import TILT, Violation
from ir_planner.curves import UniformSpline, along_motion, along_path, fewest_seconds
from ir_planner.optimize.spline_cost import beyond_limits, slowed_to_limits, spline_cost
from ir_planner.request import Context
from ir_planner.scene import PROOF_TOLERANCE, MotionLimits, tcp_inside
from ir_planner.search import at_nine_shares
from ir_planner.timing import (
    DURATION_SLACK,
    TORQUE_SHARES,
    Movement,
    check_duration,
    check_requested,
    distinct,
    objective_weights,
    straight_steps,
    within_torque,
)
from ir_values.arrays import BoolArray, FloatArray

# The stages of a descent lead from a coarse spline and a smooth cost to a fine spline and the exact
# bus.
#
# A movement of least energy holds the power of the DC link near zero for long: one joint takes
# what another gives. There the cost of a joule jumps from nothing to its full price, and a descent
# on the exact bus ends at the kink long before the least energy. So the switch is rounded, less
# from stage to stage, until the rounding weighs less than NEGLIGIBLE of the cost: movements of few
# joules take more stages.

NEGLIGIBLE = 5e-3  # share of the cost


@dataclass(frozen=True)
class DescentStage:
    """One descent: halvings of the coarse spline's intervals (level), W over which the switch of
    the DC link is rounded, stiffness of the penalties, evaluations of the cost, and the gain of ten
    steps that ends it.
    """

    level: int
    smoothing: float
    stiffness: float
    evaluations: int
    tolerance: float


@dataclass(frozen=True)
class Effort:
    """The stages of a refinement, the coarse one first."""

    stages: tuple[DescentStage, ...]

    @property
    def coarse(self) -> int:
        """Evaluations on the coarse spline."""
        return self.stages[0].evaluations

    def after(self, level: int) -> Iterator[DescentStage]:
        """The stages on finer splines."""
        return (stage for stage in self.stages if stage.level > level)

    @property
    def last(self) -> DescentStage:
        """With penalties as stiff as they get."""
        return self.stages[-1]


def decisive(stage: DescentStage, last: DescentStage, rounding: float) -> DescentStage:
    """The stage itself, or the last one at once where the rounding of the DC link, in shares of the
    cost per W of smoothing, doesn't matter any more.
    """
    return replace(last, level=stage.level) if stage.smoothing * rounding < NEGLIGIBLE else stage


QUICK = Effort(
    (
        DescentStage(0, 200.0, 1.0, 50, 1e-4),
        DescentStage(1, 60.0, 2.0, 60, 1e-4),
        DescentStage(2, 10.0, 8.0, 40, 1e-4),
        DescentStage(2, 2.0, 40.0, 30, 1e-4),
    )
)
THOROUGH = Effort(
    (
        DescentStage(0, 200.0, 1.0, 80, 5e-5),
        DescentStage(1, 60.0, 2.0, 200, 2e-5),
        DescentStage(2, 20.0, 4.0, 100, 5e-5),
        DescentStage(2, 5.0, 16.0, 80, 5e-5),
        DescentStage(2, 1.5, 40.0, 60, 5e-5),
    )
)
# Where a duration is requested, joules alone can be saved. Movements of few joules need long
# descents at every stage: one that ended early on a coarse spline ends elsewhere on the fine one, 2
# to 8 % above.
EXACT = Effort(
    (
        *(
            replace(stage, evaluations=3 * stage.evaluations, tolerance=stage.tolerance / 5)
            for stage in THOROUGH.stages
        ),
        DescentStage(3, 0.3, 40.0, 300, 1e-5),
    )
)


# The descents of one request: coarse solutions, their refinement, and repairs until it is proved.

SPACING = 0.1  # s between the knots of the coarsest spline
# control points of the coarsest spline
FEWEST = 12
MOST = 64
_FINE = 0.02  # s between knots: enough
SLOWER = 1.3  # than the path at full speed: where the descent starts
_STIFFNESS = 4.0  # of penalties, against the power that the objective is about: at least
_REPAIRS = 5
_MARGIN_STEP = 1e-3  # m of clearance margin beyond what lacked
_UPRIGHT_STEP = 1e-3  # rad that the tool is to lean less, beyond what it leaned too far
_REPAIR_EVALUATIONS = 40
_TIGHTENINGS = 4  # of the limits, where a motion of requested duration exceeds them
_TIGHTENED = 100  # evaluations after each
_TIGHTEST = 0.85  # share of the limits' speed, and of torque
_TIGHTER = 0.999  # than what was exceeded
_MOVING = 0.985  # share of the limits' speed, for ends in motion: penalties give way by as much
# shares of the speed tried where a duration is requested, until it is met
SPEED_MARGINS = (0.9995, 0.95, 0.9)
_ROUNDING = 1e-9  # relative
# penalties where a duration is requested: a second may be worth much more than usual
_STIFFER = 10.0
_LEAST_COST = 1.0  # J: of a movement that takes next to nothing
_ZONE_SAMPLES = 4  # per interval
_WITHIN_REACH = 1.06  # of a requested duration: from there more effort may get to it
# of what is left, that one descent may take: finer ones and repairs come after it
SHARE_OF_WORK = 0.4
# work of one evaluation, in certified edges: about what it takes beside one
EDGES_PER_INTERVAL = 0.25


@dataclass(frozen=True, eq=False)
class Solution:
    """A spline under optimisation: the stage it went through, its cost, the distances (R, Z) m that
    its pairs are to keep, and the shares of the limits' speed and of the torque that it is
    optimised for. upright [rad]: by how much less than it may the tool is to lean.
    """

    spline: UniformSpline
    stage: DescentStage
    cost: float
    kept: FloatArray
    speed: float = 1.0
    torque: float = TORQUE_SHARES[0]
    upright: float = 0.0

    def ended(self, spline: UniformSpline, cost: float) -> "Solution":
        """Where its descent came to."""
        return replace(self, spline=spline, cost=cost)

    @cached_property
    def places(self) -> FloatArray:
        """Configurations (9, n) by which coarse solutions are compared."""
        return at_nine_shares(self.spline.control)


# Little energy in a requested duration that leaves hardly any time.
#
# A descent at such a duration ends beyond the limits. A descent of free duration ends within them,
# because its result is slowed until they hold. So the duration is left free and its price lowered:
# from the fastest movement on, a second is worth less from step to step, until the movement takes
# all of the time that was requested.

Near = Callable[[Movement, Context], Movement | None]  # by descent from a known movement
_FIRST = 32.0  # times the robot's own price of a second, at first
_STEP = 4.0  # by so much less, or more, from step to step
_DESCENTS = 5
_ENOUGH = 0.985  # of the duration: slower would save little more than stretching does


def within_duration(fastest: Movement, context: Context, near: Near) -> Movement | None:
    """The cheapest movement found of the duration that the context requests, None where none is
    certified; fastest: one that takes at most as long.
    """
    requested = context.options.duration
    best = None
    nearest = fastest
    value = _FIRST * context.scene.cell.robot.time_value
    late = 0.0
    early = 0.0
    for _ in range(_DESCENTS):
        priced = replace(context.asking("time_and_energy").options, time_value=value)
        movement = near(nearest, replace(context, options=priced))
        duration = movement.trajectory.duration if movement is not None else float("inf")
        if movement is None or duration > requested * (1.0 + DURATION_SLACK):
            late = value
        else:
            nearest = movement
            early = value
            slower = replace(movement, context=context).stretched_by(max(requested / duration, 1.0))
            if slower.prove().certified and (best is None or slower.cost < best.cost):
                best = slower
            if duration > _ENOUGH * requested:
                break
        value = math.sqrt(late * early) if late and early else (_STEP * late or early / _STEP)
    return best


class Refinement:
    """Descents for one request."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.limits = context.limits
        scene = context.scene
        options = context.options
        rows = [scene.thresholds(options.safety_distance) - PROOF_TOLERANCE / 2]
        if context.station and scene.allowed(context.station).any():
            rows.append(context.thresholds() - PROOF_TOLERANCE / 2)
        self._kept = np.stack(rows)
        self.shortest = np.inf  # s, of movements that were tried for a requested duration
        self._costs: dict[tuple[object, ...], SplineCost] = {}  # where no pair has a larger margin

    def coarse(self, path: FloatArray, evaluations: int = QUICK.coarse) -> Solution:
        """The coarse solution near a free path (M, n), M >= 2: enough to compare paths."""
        least = fewest_seconds(path, self.limits.velocity, self.limits.acceleration)
        if self.context.motion is not None:
            change = np.abs(self.context.motion[:, 0]) / self.limits.acceleration
            least = max(least, float(change.max(axis=1).sum()))
        check_duration(least, self.context)
        count = int(np.clip(np.ceil(least / SPACING), FEWEST, MOST))
        start = along_path(path, count, self.context.options.duration or SLOWER * least)
        return self.coarse_from(self._moving(start), path, evaluations)

    def _moving(self, spline: UniformSpline) -> UniformSpline:
        """A spline from rest to rest with the motion that the request has at its ends."""
        motion = self.context.motion
        return spline if motion is None else spline.moving(motion, self.limits.acceleration)

    def coarse_along(self, trajectory: JointTrajectory, path: FloatArray) -> Solution:
        """The coarse solution near a trajectory with the request's motion at its ends; path (M, n):
        what it came from.
        """
        span = trajectory.duration
        count = int(np.clip(np.ceil(span / SPACING), FEWEST, MOST))
        fitted = along_motion(trajectory, count, self.context.options.duration or span)
        if self.context.motion is None:
            return self.coarse_from(fitted, path, THOROUGH.coarse)
        ends = np.concatenate([fitted.control[[0, -1], None], self.context.motion], axis=1)
        spline = UniformSpline(fitted.control, fitted.interval, ends)
        return self.coarse_from(spline, path, THOROUGH.coarse)

    def coarse_from(self, spline: UniformSpline, path: FloatArray, evaluations: int) -> Solution:
        """The coarse solution by descent from a spline of any origin; path (M, n): what it came
        from.
        """
        return self._optimised(self.begun(spline, evaluations), path)

    def begun(self, spline: UniformSpline, evaluations: int) -> Solution:
        """A spline about to descend with so many evaluations of the first stage."""
        speed = SPEED_MARGINS[0] if self.context.options.duration > 0.0 else 1.0
        if self.context.motion is not None:
            speed = _MOVING
        stage = replace(QUICK.stages[0], evaluations=evaluations)
        return Solution(spline, stage, np.inf, self._kept, speed)

    def refined(
        self, solution: Solution, path: FloatArray, effort: Effort = QUICK
    ) -> Movement | None:
        """The movement that a coarse solution on a path (M, n) becomes, proved; None if none can
        be.
        """
        movement = self._refined(solution, path, effort)
        if self.context.options.duration > 0.0:
            for speed in SPEED_MARGINS[1:]:
                if movement is None:
                    slower = self._optimised(replace(solution, speed=speed), path)
                    movement = self._refined(slower, path, effort)
            if movement is None and self.context.motion is None:
                return self._at_a_short_duration(path)
        return movement

    def near(self, known: Sequence[Movement]) -> Movement | None:
        """By descent from the known one whose coarse solution costs least; None if it isn't
        certified.
        """
        starts = [(self._coarse_near(one), one.path) for one in known]
        coarse, path = min(starts, key=lambda start: start[0].cost)
        movement = self.refined(coarse, path)
        return movement if movement is not None and movement.prove().certified else None

    def _coarse_near(self, known: Movement) -> Solution:
        robot = self.context.scene.cell.robot
        path = known.path
        least = fewest_seconds(path, self.limits.velocity, self.limits.acceleration)
        count = int(np.clip(np.ceil(least / SPACING), FEWEST, MOST))
        duration = max(known.trajectory.duration, least)
        start = along_motion(known.trajectory, count, self.context.options.duration or duration)
        control = np.clip(start.control, robot.position_min, robot.position_max)
        return self.coarse_from(UniformSpline(control, start.interval), path, QUICK.coarse)

    def _at_a_short_duration(self, path: FloatArray) -> Movement | None:
        """The movement near a path at a requested duration that hardly leaves joules to choose: the
        fastest one stretched, or a cheaper one.
        """
        requested = self.context.options.duration
        fastest = Refinement(self.context.asking("time"))
        for effort in (QUICK, THOROUGH):
            hurried = fastest.refined(fastest.coarse(path, effort.coarse), path, effort)
            if hurried is None:
                continue
            duration = hurried.trajectory.duration
            self.shortest = min(self.shortest, duration)
            if duration <= requested * (1.0 + DURATION_SLACK):
                movement = replace(hurried, context=self.context).stretched_by(
                    max(requested / duration, 1.0)
                )
                if movement.prove_path() is None:
                    cheaper = within_duration(
                        hurried, self.context, lambda one, asked: Refinement(asked).near([one])
                    )
                    return min(
                        (m for m in (movement, cheaper) if m is not None), key=lambda m: m.cost
                    )
            if duration > _WITHIN_REACH * requested:
                break
        return None

    def check_requested(self) -> None:
        """Raise RequestError where the requested duration is shorter than the fastest movement
        found.
        """
        if np.isfinite(self.shortest):
            check_requested(self.shortest, self.context)

    def _refined(self, solution: Solution, path: FloatArray, effort: Effort) -> Movement | None:
        """A solution through all further stages, then proved; where the proof names a pair or the
        tilt, with more margin for it, a few times. None where that doesn't help.
        """
        for stage in effort.after(solution.stage.level):
            solution = self.staged(
                solution, decisive(stage, effort.last, self._rounding(solution)), path
            )
            if (
                stage.level == effort.last.level
                and solution.stage.stiffness == effort.last.stiffness
            ):
                break
        solution = self._as_fast_as_requested(solution, path)
        for _ in range(_REPAIRS + 1):
            outcome = self._proved(solution, path)
            if not isinstance(outcome, Violation):
                return outcome
            if outcome.what == TILT:
                wider = replace(
                    solution, upright=solution.upright + max(outcome.excess, 0.0) + _UPRIGHT_STEP
                )
            elif outcome.pair is None:
                return None
            else:
                wider = self._with_larger_margin(solution, outcome)
            solution = self._repaired(wider, path, _REPAIR_EVALUATIONS)
        return None

    def staged(self, solution: Solution, stage: DescentStage, path: FloatArray) -> Solution:
        """The descent of a stage along a path (N, n), on a spline as fine as it asks for."""
        spline = solution.spline
        for _ in range(stage.level - solution.stage.level):
            spline = spline.subdivided() if spline.interval > _FINE else spline
        return self._optimised(replace(solution, spline=spline, stage=stage), path)

    def _repaired(self, solution: Solution, path: FloatArray, evaluations: int) -> Solution:
        """A short descent more, for bounds that have changed."""
        stage = replace(solution.stage, evaluations=evaluations)
        return self._optimised(replace(solution, stage=stage), path)

    def _rounding(self, solution: Solution) -> float:
        """What a watt of smoothing weighs in the cost of a movement, as a share of it."""
        worth = objective_weights(self.context, solution.spline.control).energy
        return worth * solution.spline.duration / max(solution.cost, _LEAST_COST)

    def _as_fast_as_requested(self, solution: Solution, path: FloatArray) -> Solution:
        """The solution with bounds that are tightened by as much as its motion exceeds them
        (between samples, by softness of the penalties) until it needs no more time than requested,
        or, where it is in motion at its ends and can't be slowed, none at all.
        """
        limits = self.limits.with_torque_share(TORQUE_SHARES[0])
        scene = self.context.scene
        fixed = self.context.options.duration > 0.0 or self.context.motion is not None
        for _ in range(_TIGHTENINGS if fixed else 0):
            torque, longer = beyond_limits(solution.spline, limits, scene)
            if max(torque, longer) <= 1.0:
                break
            speed = solution.speed * (_TIGHTER / longer if longer > 1.0 else 1.0)
            share = solution.torque * (_TIGHTER / torque if torque > 1.0 else 1.0)
            if min(speed, share) < _TIGHTEST:
                break
            solution = self._repaired(
                replace(solution, speed=speed, torque=share), path, _TIGHTENED
            )
        return solution

    def _optimised(self, solution: Solution, path: FloatArray) -> Solution:
        """The end of one descent, with as many evaluations as the work affords."""
        work = self.context.work
        robot = self.context.scene.cell.robot
        spline = solution.spline
        work.check()
        affordable = int(SHARE_OF_WORK * work.left / (EDGES_PER_INTERVAL * spline.intervals))
        if affordable < 1:
            return solution
        descent = self.cost(solution, path).descend(
            spline.control,
            spline.interval,
            self._rows(spline),
            fixed_interval=self.context.options.duration > 0.0,
            evaluations=min(solution.stage.evaluations, affordable),
            tolerance=solution.stage.tolerance,
            ends=spline.ends,
        )
        work.spend(int(np.ceil(descent.evaluations * spline.intervals * EDGES_PER_INTERVAL)))
        # a spline stays within the range of its control points
        control = np.minimum(np.maximum(descent.control, robot.position_min), robot.position_max)
        return solution.ended(UniformSpline(control, descent.interval, spline.ends), descent.value)

    def cost(self, solution: Solution, path: FloatArray) -> SplineCost:
        """What a solution on a path (M, n) is optimised for."""
        weights = objective_weights(self.context, path)
        stage = solution.stage
        stiffer = _STIFFER if self.context.options.duration > 0.0 else 1.0
        penalty = weights.power * max(stiffer * stage.stiffness, _STIFFNESS)
        key = (penalty, stage.smoothing, solution.speed, solution.torque, weights.travel.tobytes())
        usual = solution.kept is self._kept and solution.upright == 0.0
        cached = self._costs.get(key) if usual else None
        if cached is not None:
            return cached
        limits = self.limits.with_torque_share(solution.torque).for_speed(solution.speed)
        bounds = (solution.kept, stage.smoothing, solution.upright)
        cost = spline_cost(self.context, limits, weights, penalty, *bounds)
        if usual:
            self._costs[key] = cost
        return cost

    def _rows(self, spline: UniformSpline) -> RowArray | None:
        """Which row of thresholds holds in each interval: the station's in its zone; None: there is
        one.
        """
        if len(self._kept) == 1:
            return None
        context = self.context
        q, _, _ = spline.samples(_ZONE_SAMPLES)
        inside = tcp_inside(q, context.scene, context.station, context.safety_distance)
        whole: BoolArray = np.asarray(inside.reshape(spline.intervals, -1).all(axis=1))
        # the end of an interval is the beginning of the next
        until = np.append(whole[1:], whole[-1])
        return np.asarray(whole & until, np.int32)

    def _with_larger_margin(self, solution: Solution, found: Violation) -> Solution:
        assert found.pair is not None  # asked before
        names = (found.pair.body_a, found.pair.body_b)
        thresholds = solution.kept.copy()
        for z, pair in enumerate(self.context.scene.collision.pairs):
            if (pair.body_a, pair.body_b) == names:
                thresholds[:, z] += max(found.excess, 0.0) + _MARGIN_STEP
        return replace(solution, kept=thresholds)

    def _proved(self, solution: Solution, path: FloatArray) -> Movement | Violation | None:
        """The movement, or where it goes astray; None where its limits can't be kept."""

        def slowed(limits: MotionLimits) -> Movement | None:
            trajectory = self._slowed(solution.spline, limits)
            return None if trajectory is None else Movement(path, trajectory, self.context)

        movement = within_torque(slowed, self.context)
        if movement is None:
            return None
        astray = movement.prove_path()
        if astray is not None:
            return astray
        return movement if movement.prove_torque().violation is None else None

    def _slowed(self, spline: UniformSpline, limits: MotionLimits) -> JointTrajectory | None:
        """The motion as it is sent, slowed to its limits; None where that is not enough, or slower
        than the requested duration.
        """
        slowed = slowed_to_limits(spline, limits, self.context.scene)
        if slowed is None:
            return None
        options = self.context.options
        check_duration(slowed.duration, self.context)
        if options.duration > 0.0:
            if slowed.duration > options.duration * (1.0 + _ROUNDING):
                return None
            slowed = slowed.lasting(options.duration)
        return slowed.trajectory(self.context.joint_names)


def movement_over(path: FloatArray, context: Context) -> Movement:
    """The movement over a free path (M, n): optimised, or in straight steps where that isn't
    certified; where the joints are to take their own time, in straight steps if that serves no
    worse.

    Raises TimingError when a torque does not suffice, RequestError when the requested duration is
    too short.
    """
    if context.options.timing == "asynchronous":
        common = movement_over(path, context.with_timing("synchronous"))
        asynchronous = straight_steps(distinct(path), context)
        return (
            asynchronous
            if asynchronous.prove().certified and asynchronous.cost <= common.cost
            else common
        )
    path = distinct(path)
    if len(path) > 1:
        refinement = Refinement(context)
        for effort in (
            THOROUGH,
            QUICK,
        ):  # the second ends elsewhere, where the first isn't certified
            movement = refinement.refined(refinement.coarse(path, effort.coarse), path, effort)
            if movement is not None and movement.prove().certified:
                return movement
        refinement.check_requested()
    return straight_steps(path, context)


def optimised_near(known: Movement, context: Context) -> Movement | None:
    """The movement by descent from a known one; None where that can't be certified."""
    return Refinement(context).near([known])


def optimised_near_best(known: Sequence[Movement], context: Context) -> Movement | None:
    """The movement by descent from that of known ones, at least one, whose coarse solution costs
    least; None where that can't be certified.
    """
    return Refinement(context).near(known)
