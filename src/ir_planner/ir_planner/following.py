"""A trajectory through given points: the joint spline of eq. (10), timed within the limits.

Between the points the spline is free to swing; where that is not free, the points are joined by straight
movements that stop at each. What violates a limit or a clearance is named with the first violation.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_planner.blending import TimedPath, blended, stretched
from ir_planner.bounds import DURATION_MAX, bounded
from ir_planner.budget import Budget
from ir_planner.errors import RequestError, TimingError
from ir_planner.free_space import FreeSpace
from ir_planner.goals import within_limits
from ir_planner.journal import Journal
from ir_planner.level_timing import fastest
from ir_planner.movement import TimedMovement, distinct, stretched_to_wish, timed_movement
from ir_planner.regional import MovementPlan, end_in_collision
from ir_planner.reporting import Evaluation, evaluate_trajectory
from ir_planner.scene import PlanningScene
from ir_planner.spline_timing import time_spline
from ir_planner.time_law import StepLaws

FloatArray = NDArray[np.float64]
POINTS_MAX = 1000


@dataclass(frozen=True, eq=False)
class Reference:
    """points (M, n) rad to pass; times (M,) s at which they were wished, or None."""

    points: FloatArray
    times: FloatArray | None = None


def plan_through(
    reference: Reference, scene: PlanningScene, options: PlanOptions, budget: Budget
) -> MovementPlan:
    """Trajectory through all points, at rest at the first and the last.

    Wished times keep their proportions and are stretched where limits ask for it. Raises RequestError.
    """
    _check_points(reference, scene)
    journal = Journal(budget, options.seed)
    names = scene.cell.robot.joint_names
    start = reference.points[0]
    space = FreeSpace.of(scene, options.safety_distance, budget)
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
            movement = _ptp(points, reference, scene, options, journal.budget)
        return movement.trajectory, movement.evaluation
    limits = scene.limits.scaled(options.velocity_scaling, options.acceleration_scaling)
    names = scene.cell.robot.joint_names
    given = None
    if reference.times is not None and len(points) == len(reference.points):
        given = np.diff(reference.times)
    with journal.stage("spline") as notes:
        journal.planner_id = "spline"
        trajectory, evaluation = _spline(points, given, scene, options, journal.budget)
        violation = evaluation.verification.violation
        if violation is None or violation.what not in ("clearance", "position"):
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
    points: FloatArray, reference: Reference, scene: PlanningScene, options: PlanOptions, budget: Budget
) -> TimedMovement:
    if reference.times is None or options.duration > 0.0 or len(reference.points) != 2 or len(points) != 2:
        return timed_movement(points, scene, options, budget)
    fastest_one = timed_movement(points, scene, replace(options, objective="time"), budget)
    wished = float(reference.times[-1] - reference.times[0])
    if wished <= fastest_one.trajectory.duration:
        return fastest_one
    return timed_movement(points, scene, replace(options, duration=wished), budget)


def _spline(
    points: FloatArray,
    given: FloatArray | None,
    scene: PlanningScene,
    options: PlanOptions,
    budget: Budget,
) -> tuple[JointTrajectory, Evaluation]:
    names = scene.cell.robot.joint_names
    for share in (0.97, 0.92, 0.85):
        budget.check()
        limits = scene.limits.scaled(
            options.velocity_scaling, options.acceleration_scaling
        ).with_torque_share(share)
        quickest = time_spline(points, names, limits, scene.dynamics, given)
        wished = given is not None and options.duration == 0.0
        trajectory = stretched(quickest, 1.0) if wished else stretched_to_wish(quickest, scene, options)
        evaluation = evaluate_trajectory(trajectory, scene, options.safety_distance)
        violation = evaluation.verification.violation
        if violation is None or violation.what != "torque":
            break
    return trajectory, evaluation
