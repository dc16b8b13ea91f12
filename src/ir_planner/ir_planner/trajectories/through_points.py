"""A trajectory through given points: the joint spline of eq. (10), timed within the limits.

Between the points the spline is free to swing; where that is not free, the points are joined by
straight movements that stop at each. Where no times are given, the spline's path stays and its time
scaling becomes the best: fastest, or as the objective and the requested duration ask for; few
points are stopped at where that costs less. What violates a limit or a clearance is named with the
first violation.
"""

import functools
import itertools
from dataclasses import dataclass, replace

import numpy as np

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import FreeSpace, end_in_collision
from ir_planner.errors import RequestError, TimingError, unfit
from ir_planner.optimize import rescaled
from ir_planner.regional import MovementPlan
from ir_planner.request import DURATION_MAX, Context, Work, bounded, joint_values, within_limits
from ir_planner.scene import MotionLimits, PlanningScene
from ir_planner.timing import (
    Movement,
    StepLaws,
    TimedPath,
    at_best_duration,
    blended,
    distinct,
    fastest,
    slowed_for_tool,
    straight_steps,
    time_spline,
    with_less_reserve,
    within_torque,
)
from ir_values.argument_types import typed_methods
from ir_values.arrays import FloatArray

POINTS_MAX = 1000
_FEW = 60  # points that are stopped at where that costs less than a spline
_AT_STOPS = ("clearance", "position")  # violations that straight steps avoid


@typed_methods(unfit)
@dataclass(frozen=True, eq=False)
class Reference:
    """points (M, n) rad to pass; times (M,) s at which they are requested, or None."""

    points: FloatArray
    times: FloatArray | None = None


def plan_through(
    reference: Reference, scene: PlanningScene, options: PlanOptions, work: Work
) -> MovementPlan:
    """Trajectory through all points, at rest at the first and the last.

    Given times keep their proportions and are stretched where limits ask for it. Raises
    RequestError.
    """
    reference = _checked_reference(reference, scene)
    context = Context.of(scene, options, work)
    if options.planner_id:
        sentence = (
            f"planner_id {options.planner_id} is not used: nothing is searched between given points"
        )
        context.journal.note("options", sentence)
    start = reference.points[0]
    space = FreeSpace.of(scene, options.safety_distance, work)
    blocked = end_in_collision(start, reference.points[-1], space, options.safety_distance)
    if blocked is not None:
        return MovementPlan(
            blocked, context.journal.info(start, context.joint_names), TrajectoryReport()
        )
    try:
        movement = _with_what_torque_there_is(reference, context)
    except TimingError as error:
        status = Status(StatusCode.INVALID_MOTION_PLAN, str(error))
        return MovementPlan(
            status, context.journal.info(start, context.joint_names), TrajectoryReport()
        )
    context.journal.timing = movement.timing
    info = context.journal.info(start, context.joint_names)
    status = movement.prove().status
    if not status.ok:
        return MovementPlan(status, info, movement.report)
    return MovementPlan(status, info, movement.report, movement.trajectory, reference.points)


def _with_what_torque_there_is(reference: Reference, context: Context) -> Movement:
    """The movement with the torque reserve that is asked for, or as much of it as the load leaves.
    Raises TimingError.
    """
    try:
        return _followed(reference, context)
    except TimingError as error:
        reason = error
    for eased in with_less_reserve(itertools.pairwise(reference.points), context):
        try:
            return _followed(reference, eased)
        except TimingError as error:
            reason = error
    raise reason


def _checked_reference(reference: Reference, scene: PlanningScene) -> Reference:
    """The reference with its points within the limits; RequestError for what can't be driven."""
    count = len(reference.points)
    if not 1 <= count <= POINTS_MAX:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            f"the reference has {count} points: it must have 1 to {POINTS_MAX}",
        )
    if reference.times is not None:
        times = joint_values(reference.times, (count,), "times", StatusCode.INVALID_MOTION_PLAN)
        for k, time in enumerate(times):
            bounded(time, 0.0, DURATION_MAX, f"time of point {k}", "s")
    points = [
        within_limits(q, scene.cell, f"point {k}", StatusCode.INVALID_MOTION_PLAN)
        for k, q in enumerate(reference.points)
    ]
    return replace(reference, points=np.array(points))


def _followed(reference: Reference, context: Context) -> Movement:
    """The spline through the points where it is certified, else straight movements that stop at
    each; two points are a PTP.
    """
    points = distinct(reference.points)
    journal = context.journal
    if len(points) < 3:
        with journal.stage("ptp"):
            journal.planner_id = "ptp"
            return _ptp(points, reference, context)
    timed = reference.times is not None and len(points) == len(reference.points)
    rival = None if timed or len(points) > _FEW else _certified_stops(points, context)
    with journal.stage("spline") as notes:
        journal.planner_id = "spline"
        try:
            smooth = _smooth(points, reference.times if timed else None, context, notes)
        except (TimingError, RequestError) as error:
            if rival is None:
                raise
            notes.append(str(error))
        else:
            violation = smooth.prove().violation
            if violation is not None and violation.what in _AT_STOPS:
                notes.append(violation.sentence)
            elif violation is not None or rival is None or smooth.cost <= rival.cost:
                return smooth
    with journal.stage("stops") as notes:
        journal.planner_id = "stops"
        notes.append("straight between the points, stopping at each")
        return rival or _stopping(points, context)


def _smooth(
    points: FloatArray, times: FloatArray | None, context: Context, notes: list[str]
) -> Movement:
    """The spline through the points, at times (M,) or timed as is best. Raises TimingError,
    RequestError.
    """
    if times is None:
        return best_along(points, context, notes)
    return _in_proportion(points, np.diff(times), context)


def _certified_stops(points: FloatArray, context: Context) -> Movement | None:
    """The movement that stops at each point, each part as fast as is best; None where it isn't
    certified.
    """
    try:
        if context.options.duration > 0.0:
            stopping = _stopping(points, context)
        else:
            parts = [straight_steps(np.array(pair), context) for pair in itertools.pairwise(points)]
            joined = functools.reduce(JointTrajectory.then, (part.trajectory for part in parts))
            stopping = Movement(points, joined, context)
    except (TimingError, RequestError):
        return None
    return stopping if stopping.prove().certified else None


def _ptp(points: FloatArray, reference: Reference, context: Context) -> Movement:
    given = reference.times is not None and len(reference.points) == 2 and len(points) == 2
    if not given or context.options.duration > 0.0:
        return straight_steps(points, context)
    assert reference.times is not None
    quickest = straight_steps(points, context.asking("time"))
    duration = float(reference.times[-1] - reference.times[0])
    if duration <= quickest.trajectory.duration:
        return quickest
    return straight_steps(points, context.asking(context.options.objective, duration))


def _stopping(points: FloatArray, context: Context) -> Movement:
    """Straight between the points, at rest at each."""
    dynamics = context.scene.dynamics
    laws = tuple(
        StepLaws((fastest(a, b, context.limits, dynamics),)) for a, b in itertools.pairwise(points)
    )
    quickest = blended(TimedPath(points, laws, (0,) * (len(laws) - 1)), context.joint_names)
    return Movement(points, at_best_duration(quickest, context), context)


def _in_proportion(points: FloatArray, durations: FloatArray | None, context: Context) -> Movement:
    """The spline whose intervals last `durations` (M-1,) s or longer in the same proportions; None:
    as limits ask for.
    """
    free = durations is not None and context.options.duration == 0.0

    def timed(limits: MotionLimits) -> Movement:
        quickest = time_spline(
            points, context.joint_names, limits, context.scene.dynamics, durations
        )
        trajectory = (
            slowed_for_tool(quickest, context) if free else at_best_duration(quickest, context)
        )
        return Movement(points, trajectory, context)

    movement = within_torque(timed, context)
    assert movement is not None  # timed always makes one
    return movement


def best_along(points: FloatArray, context: Context, notes: list[str]) -> Movement:
    """The path of the spline whose intervals are timed by rules, with the best time scaling along
    it.
    """
    hurry = context.asking("time")
    by_rules = _in_proportion(points, None, hurry)
    if by_rules.prove().violation is not None:
        return by_rules
    quickest = rescaled(by_rules, hurry)
    best = by_rules
    if quickest is not None and quickest.trajectory.duration < by_rules.trajectory.duration:
        notes.append(_note(by_rules, quickest))
        best = quickest
    best = Movement(points, at_best_duration(best.trajectory, context), context)
    if context.options.duration > 0.0 or context.options.objective in ("energy", "time_and_energy"):
        better = rescaled(by_rules, context)
        if better is not None and better.coarse_energy_cost < best.coarse_energy_cost:
            notes.append(_note(best, better))
            best = better
    return best


def _note(before: Movement, after: Movement) -> str:
    return (
        f"time scaling: {after.trajectory.duration:.3f} s instead of "
        f"{before.trajectory.duration:.3f} s, {after.note}"
    )
