"""A trajectory through given points: the joint spline of eq. (10), timed within the limits.

Between the points the spline is free to swing; where that is not free, the points are joined by straight
movements that stop at each. Where no times are wished, the spline's path stays and its pace becomes the best:
fastest, or as the objective and the wished duration ask for. What violates a limit or a clearance is named
with the first violation.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory

from ir_planner.checks import Evaluation, FreeSpace, end_in_collision, evaluate_trajectory
from ir_planner.errors import RequestError, TimingError
from ir_planner.optimize import Paced, along_its_path
from ir_planner.regional import MovementPlan
from ir_planner.request import DURATION_MAX, Journal, Work, bounded, within_limits
from ir_planner.scene import MotionLimits, PlanningScene
from ir_planner.timing import (
    StepLaws,
    TimedMovement,
    TimedPath,
    blended,
    distinct,
    fastest,
    pace_value,
    stretched,
    stretched_to_wish,
    time_spline,
    timed_movement,
)

POINTS_MAX = 1000
KEPT = 1e-3  # rad by which a pace may leave its path
_AT_STOPS = ("clearance", "position")  # violations that straight steps avoid
_TORQUE_SHARES = (0.97, 0.92, 0.85)


@dataclass(frozen=True, eq=False)
class Reference:
    """points (M, n) rad to pass; times (M,) s at which they were wished, or None."""

    points: FloatArray
    times: FloatArray | None = None


def plan_through(
    reference: Reference, scene: PlanningScene, options: PlanOptions, work: Work
) -> MovementPlan:
    """Trajectory through all points, at rest at the first and the last.

    Wished times keep their proportions and are stretched where limits ask for it. Raises RequestError.
    """
    _check_points(reference, scene)
    journal = Journal(work, options.seed)
    names = scene.cell.robot.joint_names
    start = reference.points[0]
    space = FreeSpace.of(scene, options.safety_distance, work)
    blocked = end_in_collision(start, reference.points[-1], space, options.safety_distance)
    if blocked is not None:
        return MovementPlan(blocked, journal.info(start, names), TrajectoryReport())
    try:
        trajectory, evaluation = _followed(reference, scene, options, journal)
    except TimingError as error:
        status = Status(StatusCode.INVALID_MOTION_PLAN, str(error))
        return MovementPlan(status, journal.info(start, names), TrajectoryReport())
    info = journal.info(start, names)
    status = evaluation.verification.status
    if not status.ok:
        return MovementPlan(status, info, evaluation.report)
    return MovementPlan(status, info, evaluation.report, trajectory, reference.points)


def _check_points(reference: Reference, scene: PlanningScene) -> None:
    if len(reference.points) > POINTS_MAX:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            f"the reference has {len(reference.points)} points: at most {POINTS_MAX} are taken",
        )
    if reference.times is not None:
        bounded(float(reference.times[-1]), 0.0, DURATION_MAX, "time of the last point", "s")
    for k, q in enumerate(reference.points):
        within_limits(q, scene.cell, f"point {k}", StatusCode.INVALID_MOTION_PLAN)


def _followed(
    reference: Reference, scene: PlanningScene, options: PlanOptions, journal: Journal
) -> tuple[JointTrajectory, Evaluation]:
    points = distinct(reference.points)
    if len(points) < 3:
        with journal.stage("ptp"):
            journal.planner_id = "ptp"
            movement = _ptp(points, reference, scene, options, journal.work)
        return movement.trajectory, movement.evaluation
    limits = scene.limits.scaled(options.velocity_scaling, options.acceleration_scaling)
    names = scene.cell.robot.joint_names
    given = None
    if reference.times is not None and len(points) == len(reference.points):
        given = np.diff(reference.times)
    with journal.stage("spline") as notes:
        journal.planner_id = "spline"
        timed = _spline if given is not None else _best_pace
        trajectory, evaluation = timed(points, given, scene, options, journal, notes)
        violation = evaluation.verification.violation
        if violation is None or violation.what not in _AT_STOPS:
            return trajectory, evaluation
        notes.append(violation.sentence)
    with journal.stage("stops") as notes:
        journal.planner_id = "stops"
        laws = tuple(
            StepLaws((fastest(a, b, limits, scene.dynamics),)) for a, b in itertools.pairwise(points)
        )
        quickest = blended(TimedPath(points, laws, (0,) * (len(laws) - 1)), names)
        stopping = stretched_to_wish(quickest, scene, options)
        straight = evaluate_trajectory(stopping, scene, options.safety_distance)
        notes.append("straight between the points, stopping at each")
    return stopping, straight


def _ptp(
    points: FloatArray, reference: Reference, scene: PlanningScene, options: PlanOptions, work: Work
) -> TimedMovement:
    if reference.times is None or options.duration > 0.0 or len(reference.points) != 2 or len(points) != 2:
        return timed_movement(points, scene, options, work)
    fastest_one = timed_movement(points, scene, replace(options, objective="time"), work)
    wished = float(reference.times[-1] - reference.times[0])
    if wished <= fastest_one.trajectory.duration:
        return fastest_one
    return timed_movement(points, scene, replace(options, duration=wished), work)


def _spline(
    points: FloatArray,
    given: FloatArray | None,
    scene: PlanningScene,
    options: PlanOptions,
    journal: Journal,
    notes: list[str],
) -> tuple[JointTrajectory, Evaluation]:
    """The spline with the durations `given` (M-1,) s in their proportions."""
    for share in _TORQUE_SHARES:
        journal.work.check()
        limits = _limits(scene, options, share)
        quickest = time_spline(points, scene.cell.robot.joint_names, limits, scene.dynamics, given)
        wished = given is not None and options.duration == 0.0
        trajectory = stretched(quickest, 1.0) if wished else stretched_to_wish(quickest, scene, options)
        evaluation = evaluate_trajectory(trajectory, scene, options.safety_distance)
        violation = evaluation.verification.violation
        if violation is None or violation.what != "torque":
            break
    return trajectory, evaluation


def _best_pace(
    points: FloatArray,
    given: FloatArray | None,
    scene: PlanningScene,
    options: PlanOptions,
    journal: Journal,
    notes: list[str],
) -> tuple[JointTrajectory, Evaluation]:
    """The path of the spline whose intervals are timed by rules, at the best pace along it."""
    hurry = replace(options, objective="time", duration=0.0)
    quickest, evaluation = _spline(points, None, scene, hurry, journal, notes)
    if evaluation.verification.violation is not None:
        return quickest, evaluation
    by_rules = quickest
    pace = _paced(by_rules, points, scene, hurry, journal)
    if pace is not None and pace.trajectory.duration < quickest.duration:
        notes.append(_note(quickest, pace))
        quickest = pace.trajectory
    trajectory = stretched_to_wish(quickest, scene, options)
    if options.duration > 0.0 or options.objective in ("energy", "time_and_energy"):
        pace = _paced(by_rules, points, scene, options, journal)
        if pace is not None and _value(pace.trajectory, scene, options) < _value(trajectory, scene, options):
            notes.append(_note(trajectory, pace))
            trajectory = pace.trajectory
    return trajectory, evaluate_trajectory(trajectory, scene, options.safety_distance)


def _paced(
    trajectory: JointTrajectory,
    points: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    journal: Journal,
) -> Paced | None:
    """The certified pace along a trajectory's path; None where there is none, or no work left for it."""
    for share in _TORQUE_SHARES:
        if journal.work.exhausted:
            return None
        limits = _limits(scene, options, share)
        pace = along_its_path(trajectory, points, scene, options, limits, journal.work)
        if pace is None or pace.deviation > KEPT:
            journal.reject("no better pace along the path")
            return None
        verification = evaluate_trajectory(pace.trajectory, scene, options.safety_distance).verification
        if verification.violation is None:
            return pace
        journal.reject(f"a pace along the path isn't certified: {verification.violation.what}")
        if verification.violation.what != "torque":
            return None
    return None


def _limits(scene: PlanningScene, options: PlanOptions, share: float) -> MotionLimits:
    scaled = scene.limits.scaled(options.velocity_scaling, options.acceleration_scaling)
    return scaled.with_torque_share(share)


def _value(trajectory: JointTrajectory, scene: PlanningScene, options: PlanOptions) -> float:
    """What decides between two paces on one path."""
    return pace_value(trajectory, scene, options.objective, options.time_value)


def _note(before: JointTrajectory, pace: Paced) -> str:
    return (
        f"pace: {pace.trajectory.duration:.3f} s instead of {before.duration:.3f} s, within "
        f"{pace.deviation * 1e3:.2f} mrad of its path"
    )
