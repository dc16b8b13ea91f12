"""From waypoints to a certified movement: laws in time, corners cut as far as allowed, the duration that
pays.

Proved free are the straight steps between waypoints. Cutting corners leaves them, so the blended trajectory
is certified itself, and each corner that is in the way is cut less, down to a stop. Then the whole movement
is stretched to the duration that the objective likes best, and what is sent is verified as it is
interpolated.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory

from ir_planner.checks import Evaluation, Violation, clearance_violation, evaluate_trajectory
from ir_planner.curves import extremes
from ir_planner.errors import RequestError
from ir_planner.request import DURATION_MAX, Work
from ir_planner.scene import STILL, Dynamics, MotionLimits, PlanningScene
from ir_planner.timing.asynchronous import own_laws
from ir_planner.timing.blending import TimedPath, blended, largest_overlaps, standing, stretched
from ir_planner.timing.level_timing import fastest
from ir_planner.timing.objective import best_stretch, pace_value
from ir_planner.timing.ptp import fastest_law, torque_per_segment
from ir_planner.timing.time_law import GRID_S, Law, StepLaws

_TORQUE_SHARES = (0.98, 0.95, 0.9, 0.8)
MakeLaw = Callable[[FloatArray, FloatArray, MotionLimits, Dynamics], Law]
# how steps are timed, and the share of the acceleration they may use; the fastest first
_SHAPES: tuple[tuple[MakeLaw, float], ...] = ((fastest, 1.0), (fastest_law, 1.0), (fastest_law, 0.6))
_CUTS = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1, 0.0)
DURATION_SLACK = 1e-6


@dataclass(frozen=True, eq=False)
class TimedMovement:
    """A trajectory with everything that is known about it; `note` says where it differs from what was
    asked.
    """

    waypoints: FloatArray
    trajectory: JointTrajectory
    evaluation: Evaluation
    note: str = ""

    @property
    def violation(self) -> Violation | None:
        """None: certified."""
        return self.evaluation.verification.violation


def timed_movement(
    waypoints: FloatArray, scene: PlanningScene, options: PlanOptions, work: Work, station: str = ""
) -> TimedMovement:
    """The movement over `waypoints` (M, n), whose straight steps are free, at the best duration for the
    objective.

    Raises TimingError when a torque does not suffice, RequestError when the wished duration is too short.
    """
    waypoints = distinct(waypoints)
    names = scene.cell.robot.joint_names
    if len(waypoints) == 1:
        trajectory = standing(waypoints[0], names)
        evaluation = evaluate_trajectory(trajectory, scene, options.safety_distance, station)
        return TimedMovement(waypoints, trajectory, evaluation, "the goal is the start")
    for share in _TORQUE_SHARES:
        work.check()
        limits = scene.limits.scaled(
            options.velocity_scaling, options.acceleration_scaling
        ).with_torque_share(share)
        trajectory, note = _paced(waypoints, scene, options, limits, work, station)
        work.check()
        evaluation = evaluate_trajectory(trajectory, scene, options.safety_distance, station)
        violation = evaluation.verification.violation
        if violation is None or violation.what != "torque":
            break
    return TimedMovement(waypoints, trajectory, evaluation, note)


def distinct(waypoints: FloatArray) -> FloatArray:
    """The waypoints without those that are where the one before is."""
    keep = [0]
    for k in range(1, len(waypoints)):
        if np.max(np.abs(waypoints[k] - waypoints[keep[-1]])) >= STILL:
            keep.append(k)
    result = np.array(waypoints[keep])
    if len(keep) > 1:
        result[-1] = waypoints[-1]
    return result


def _paced(
    waypoints: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    limits: MotionLimits,
    work: Work,
    station: str,
) -> tuple[JointTrajectory, str]:
    """The trajectory in the shape and at the duration that the objective likes best.

    The fastest shape is not always the one that costs the least joules once it is stretched.
    """
    best: tuple[float, JointTrajectory, str] | None = None
    for law, share in _SHAPES if _joules_count(options) else _SHAPES[:1]:
        work.check()
        gentle = limits.scaled(1.0, share)
        quickest, note = _fastest(waypoints, scene, options, gentle, work, station, law)
        if best is not None and 0.0 < options.duration < quickest.duration:
            continue
        trajectory = stretched_to_wish(quickest, scene, options)
        if not _joules_count(options):
            return trajectory, note
        value = pace_value(trajectory, scene, options.objective, options.time_value)
        if best is None or value < best[0]:
            best = (value, trajectory, note)
    assert best is not None  # the first shape is taken or refused
    return best[1], best[2]


def _joules_count(options: PlanOptions) -> bool:
    return options.duration > 0.0 or options.objective in ("energy", "time_and_energy")


def _fastest(
    waypoints: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    limits: MotionLimits,
    work: Work,
    station: str,
    law: MakeLaw,
) -> tuple[JointTrajectory, str]:
    names, dynamics = scene.cell.robot.joint_names, scene.dynamics
    steps = list(itertools.pairwise(waypoints))
    note = ""
    if options.timing == "asynchronous":
        laws = tuple(own_laws(a, b, limits, dynamics) for a, b in steps)
        trajectory = blended(TimedPath(waypoints, laws, (0,) * (len(laws) - 1)), names)
        blocked = clearance_violation(trajectory, scene, options.safety_distance, station)
        if blocked is None:
            return trajectory, note
        note = f"asynchronous timing is not free ({blocked.sentence}), so the timing is synchronous"
    laws = tuple(StepLaws((law(a, b, limits, dynamics),)) for a, b in steps)
    return _cut_corners(waypoints, laws, scene, options, limits, work, station), note


def _cut_corners(
    waypoints: FloatArray,
    laws: tuple[StepLaws, ...],
    scene: PlanningScene,
    options: PlanOptions,
    limits: MotionLimits,
    work: Work,
    station: str,
) -> JointTrajectory:
    """The blended trajectory with the largest overlaps that keep limits and clearance."""
    names = scene.cell.robot.joint_names
    largest = largest_overlaps(laws)
    cut = [0] * len(largest)  # index into _CUTS per corner
    while True:
        work.check()
        overlaps = tuple(int(full * _CUTS[k]) for full, k in zip(largest, cut, strict=True))
        path = TimedPath(waypoints, laws, overlaps)
        trajectory = blended(path, names)
        guilty = _guilty_corners(path, trajectory, scene, limits)
        if not guilty and any(overlaps):
            violation = clearance_violation(trajectory, scene, options.safety_distance, station)
            guilty = set() if violation is None else _corners_at(path, violation.time)
        guilty = {corner for corner in guilty if overlaps[corner] > 0}
        if not guilty:
            return trajectory
        for corner in guilty:
            cut[corner] += 1


def _corners_at(path: TimedPath, time: float) -> set[int]:
    """The corner whose overlap is nearest to an instant [s]."""
    windows = [path.corner_window(corner) for corner in range(len(path.overlaps))]
    step = time / GRID_S
    away = [max(begin - step, step - end, 0.0) if end > begin else np.inf for begin, end in windows]
    return {int(np.argmin(away))} if away else set()


def _guilty_corners(
    path: TimedPath, trajectory: JointTrajectory, scene: PlanningScene, limits: MotionLimits
) -> set[int]:
    """Corners in whose overlap a limit is exceeded."""
    if not any(path.overlaps):
        return set()
    coefficients, durations = trajectory.coefficients()
    largest = extremes(coefficients, durations)
    share = np.maximum.reduce(
        [
            largest.velocity / limits.velocity,
            largest.acceleration / limits.acceleration,
            largest.jerk / limits.jerk,
            torque_per_segment(trajectory, scene.dynamics) / limits.torque_share,
        ]
    ).max(axis=1)
    middle = 0.5 * (trajectory.times[:-1] + trajectory.times[1:])
    guilty: set[int] = set()
    for k in np.flatnonzero(share > 1.0 + 1e-6):
        for corner in range(len(path.overlaps)):
            begin, end = path.corner_window(corner)
            if begin <= middle[k] / GRID_S <= end:
                guilty.add(corner)
    return guilty


def check_duration(duration: float, options: PlanOptions) -> None:
    """Raise RequestError where a movement would last longer than any may."""
    if duration > DURATION_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"velocity_scaling {options.velocity_scaling:g} and acceleration_scaling "
            f"{options.acceleration_scaling:g} make a movement of {duration:.4g} s: "
            f"it must be at most {DURATION_MAX:g} s",
        )


def stretched_to_wish(
    quickest: JointTrajectory, scene: PlanningScene, options: PlanOptions
) -> JointTrajectory:
    """The fastest trajectory at the wished duration, or at the one the objective likes best.

    Raises RequestError when the wished duration is shorter than the fastest, or that longer than any may be.
    """
    check_duration(quickest.duration, options)
    if options.duration > 0.0:
        if options.duration < quickest.duration * (1.0 - DURATION_SLACK):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"duration is {options.duration:g} s: the shortest within the limits is "
                f"{quickest.duration:.4g} s",
            )
        return stretched(quickest, max(options.duration / quickest.duration, 1.0))
    return stretched(quickest, best_stretch(quickest, scene, options.objective, options.time_value))
