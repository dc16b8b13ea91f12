"""A movement in straight steps between waypoints: laws in time, corners cut as far as allowed, the
best duration.

Proved free are the straight steps between waypoints. Cutting corners leaves them, so the blended
trajectory is certified itself, and a corner whose overlap violates something is cut less, down to a
stop. Then the whole movement is stretched to the duration that the objective likes best.
"""

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import SLACK, Violation, clearance_violation, tilt_violation
from ir_planner.curves import extremes
from ir_planner.request import Context
from ir_planner.scene import STILL, Dynamics, MotionLimits, lasting_longer, torque_use
from ir_planner.timing.blended_steps import TimedPath, blended, largest_overlaps, standing
from ir_planner.timing.jerk_limited_laws import (
    GRID_S,
    Law,
    LawLimits,
    StepLaws,
    TimeLaw,
    phase_steps,
)
from ir_planner.timing.movement import Movement, within_torque
from ir_planner.timing.objective import at_best_duration, coarse_energy_cost
from ir_planner.timing.ptp import fastest, fastest_law, torque_per_segment
from ir_values.arrays import FloatArray

# Asynchronous PTP: every joint takes its own time and stops when it has arrived. Where all of the
# fastest laws together ask too much of some joint's torque, single joints keep to the synchronous
# law of the step, as few as possible: the movement never takes longer than the synchronous one. The
# joints leave the straight line between start and goal. Where that is not free, joints keep to the
# synchronous law too, those first that leave the line most.

_SAMPLE = 4  # grid steps


def own_laws(
    start: FloatArray, delta: FloatArray, common: Law, limits: MotionLimits, dynamics: Dynamics
) -> tuple[StepLaws, frozenset[int]]:
    """Laws of the joints from `start` by `delta` (n,), each as fast as it can with all torques
    within their share, and the joints that keep to the `common` law instead.

    From the joint that gains least by it to the one that gains most, each takes its own law where
    torque allows.
    """
    own = _fastest_asynchronous(delta, limits)
    if _is_within_torque(start, delta, own, limits, dynamics):
        return own, frozenset()
    moving = np.flatnonzero(np.abs(delta) >= STILL)
    joined = frozenset(int(j) for j in moving)
    for joint in sorted(moving, key=lambda j: -own.laws[j].total):
        fewer = joined - {int(joint)}
        if _is_within_torque(start, delta, _mixed(own, common, fewer), limits, dynamics):
            joined = fewer
    return _mixed(own, common, joined), joined


def farthest_from_line(
    laws: StepLaws, common: Law, delta: FloatArray, step: int, joined: frozenset[int]
) -> int | None:
    """The joint of delta (n,) that is farthest from where the `common` law has it at grid step
    `step`, of those that haven't `joined` it; None where none is left.
    """
    s, _, _ = laws.at(np.array([step]))
    on_line, _, _ = common.at(np.array([step]))
    away = np.abs((s[0] - on_line[0]) * delta)
    away[list(joined)] = -1.0
    away[np.abs(delta) < STILL] = -1.0
    joint = int(np.argmax(away))
    return joint if away[joint] >= 0.0 else None


def joining(laws: StepLaws, common: Law, joint: int) -> StepLaws:
    """The laws (one per joint) with one joint more on the common law."""
    return _mixed(laws, common, frozenset({joint}))


def _mixed(own: StepLaws, common: Law, joined: frozenset[int]) -> StepLaws:
    return StepLaws(tuple(common if j in joined else law for j, law in enumerate(own.laws)))


def _fastest_asynchronous(delta: FloatArray, limits: MotionLimits) -> StepLaws:
    """The fastest law of each joint alone, whatever the torque."""
    size = np.maximum(np.abs(delta), STILL)
    acceleration = limits.acceleration / size
    bounds = LawLimits(limits.velocity / size, acceleration, acceleration, limits.jerk / size)
    return StepLaws(tuple(TimeLaw(tuple(int(k) for k in row)) for row in phase_steps(bounds)))


def _is_within_torque(
    start: FloatArray, delta: FloatArray, laws: StepLaws, limits: MotionLimits, dynamics: Dynamics
) -> bool:
    """Whether torque stays within its share at samples of the laws."""
    switches = laws.switches()
    at = np.unique(np.concatenate([np.arange(0, laws.total, _SAMPLE), switches, switches[1:] - 1]))
    s, sd, sdd = laws.at(at.astype(np.int64))
    use = torque_use(dynamics, start + s * delta, sd * delta, sdd * delta)
    return bool(use.max() <= limits.torque_share)


MakeLaw = Callable[[FloatArray, FloatArray, MotionLimits, Dynamics], Law]
# how steps are timed, and the share of the acceleration they may use; the fastest first. The
# fastest is not always the one that costs the least joules once it is stretched.
_SHAPES: tuple[tuple[MakeLaw, float], ...] = (
    (fastest, 1.0),
    (fastest_law, 1.0),
    (fastest_law, 0.6),
)
_NO_OWN_LAW = "neither torque nor clearance leaves a joint its own law: synchronous"
_CUTS = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1, 0.0)  # shares of the largest overlap, down to a stop


def straight_steps(waypoints: FloatArray, context: Context) -> Movement:
    """The movement over `waypoints` (M, n), whose straight steps are free, at the best duration for
    the objective.

    Raises TimingError when a torque does not suffice, RequestError when the requested duration is
    too short.
    """
    waypoints = distinct(waypoints)
    if len(waypoints) == 1:
        trajectory = standing(waypoints[0], context.joint_names, context.options.duration)
        return Movement(waypoints, trajectory, context, "the goal is the start")

    def timed(limits: MotionLimits) -> Movement:
        found = _best_shape(waypoints, limits, context)
        return Movement(waypoints, found.trajectory, context, found.note, found.timing)

    movement = within_torque(timed, context)
    assert movement is not None  # timed always makes one
    return movement


def distinct(waypoints: FloatArray) -> FloatArray:
    """The waypoints (M, n) without those that are where the one before is."""
    keep = [0]
    for k in range(1, len(waypoints)):
        if np.max(np.abs(waypoints[k] - waypoints[keep[-1]])) >= STILL:
            keep.append(k)
    result = np.array(waypoints[keep])
    if len(keep) > 1:
        result[-1] = waypoints[-1]
    return result


class TimedSteps(NamedTuple):
    """A trajectory over straight steps, its timing ("synchronous" where no joint has its own law),
    and a note where that is not the one asked for.
    """

    trajectory: JointTrajectory
    timing: str
    note: str


def _best_shape(waypoints: FloatArray, limits: MotionLimits, context: Context) -> TimedSteps:
    """The trajectory in the shape and at the duration that the objective likes best."""
    options = context.options
    best: tuple[float, TimedSteps] | None = None
    for law, share in _SHAPES if _joules_count(options) else _SHAPES[:1]:
        context.work.check()
        quickest = _fastest(waypoints, limits.scaled(1.0, share), law, context)
        if best is not None and 0.0 < options.duration < quickest.trajectory.duration:
            continue
        timed = quickest._replace(trajectory=at_best_duration(quickest.trajectory, context))
        if not _joules_count(options):
            return timed
        value = coarse_energy_cost(timed.trajectory, context)
        if best is None or value < best[0]:
            best = (value, timed)
    assert best is not None  # the first shape is taken or refused
    return best[1]


def _joules_count(options: PlanOptions) -> bool:
    return options.duration > 0.0 or options.objective in ("energy", "time_and_energy")


def _fastest(
    waypoints: FloatArray, limits: MotionLimits, law: MakeLaw, context: Context
) -> TimedSteps:
    """The fastest trajectory in one shape."""
    common = [law(a, b, limits, context.scene.dynamics) for a, b in itertools.pairwise(waypoints)]
    synchronous = context.options.timing == "synchronous"
    found = None if synchronous else _each_joint_alone(waypoints, common, limits, context)
    if found is not None:
        return TimedSteps(found[0], "asynchronous", found[1])
    trajectory = _cut_corners(waypoints, tuple(StepLaws((one,)) for one in common), limits, context)
    return TimedSteps(trajectory, "synchronous", "" if synchronous else _NO_OWN_LAW)


def _each_joint_alone(
    waypoints: FloatArray, common: list[Law], limits: MotionLimits, context: Context
) -> tuple[JointTrajectory, str] | None:
    """Joints with a law each, and a note which of them keep to the `common` laws (one per step);
    None where all have to.
    """
    deltas = np.diff(waypoints, axis=0)
    names = context.joint_names
    found = [
        own_laws(start, delta, law, limits, context.scene.dynamics)
        for start, delta, law in zip(waypoints[:-1], deltas, common, strict=True)
    ]
    laws = [own for own, _ in found]
    joined = [joints for _, joints in found]
    while True:
        context.work.check()
        path = TimedPath(waypoints, tuple(laws), (0,) * (len(laws) - 1))
        trajectory = blended(path, names)
        blocked = _blocked(trajectory, context)
        if blocked is None:
            break
        at = int(blocked.time / GRID_S)
        k = int(np.searchsorted(path.starts, at, side="right")) - 1
        joint = farthest_from_line(
            laws[k], common[k], deltas[k], at - int(path.starts[k]), joined[k]
        )
        if joint is None:
            return None
        laws[k] = joining(laws[k], common[k], joint)
        joined[k] = joined[k] | {joint}
    if sum(len(joints) for joints in joined) == int((np.abs(deltas) >= STILL).sum()):
        return None
    kept = ", ".join(names[j] for j in sorted({j for joints in joined for j in joints}))
    return (
        trajectory,
        f"keep to the synchronous law for torque or clearance: {kept}" if kept else "",
    )


def _blocked(trajectory: JointTrajectory, context: Context) -> Violation | None:
    found = clearance_violation(trajectory, context.scene, context.safety_distance, context.station)
    return found or tilt_violation(trajectory, context.cone)


def _cut_corners(
    waypoints: FloatArray, laws: tuple[StepLaws, ...], limits: MotionLimits, context: Context
) -> JointTrajectory:
    """The blended trajectory with the largest overlaps that keep limits and clearance."""
    largest = largest_overlaps(laws)
    cut = [0] * len(largest)  # index into _CUTS per corner
    while True:
        context.work.check()
        overlaps = tuple(int(full * _CUTS[k]) for full, k in zip(largest, cut, strict=True))
        path = TimedPath(waypoints, laws, overlaps)
        trajectory = blended(path, context.joint_names)
        violating = _corners_beyond_limits(path, trajectory, limits, context)
        if not violating and any(overlaps):
            violation = _blocked(trajectory, context)
            violating = set() if violation is None else _corner_at(path, violation.time)
        violating = {corner for corner in violating if overlaps[corner] > 0}
        if not violating:
            return trajectory
        for corner in violating:
            cut[corner] += 1


def _corner_at(path: TimedPath, time: float) -> set[int]:
    """The corner whose overlap is nearest to an instant [s]."""
    windows = [path.corner_window(corner) for corner in range(len(path.overlaps))]
    step = time / GRID_S
    away = [max(begin - step, step - end, 0.0) if end > begin else np.inf for begin, end in windows]
    return {int(np.argmin(away))} if away else set()


def _corners_beyond_limits(
    path: TimedPath, trajectory: JointTrajectory, limits: MotionLimits, context: Context
) -> set[int]:
    """Corners in whose overlap a limit is exceeded."""
    if not any(path.overlaps):
        return set()
    largest = extremes(*trajectory.coefficients())
    torque = torque_per_segment(trajectory, context.scene.dynamics)
    use = lasting_longer(limits, largest.velocity, largest.acceleration, largest.jerk, torque)
    middle = 0.5 * (trajectory.times[:-1] + trajectory.times[1:]) / GRID_S
    beyond = middle[use > 1.0 + SLACK]
    windows = [path.corner_window(corner) for corner in range(len(path.overlaps))]
    return {
        k for k, (begin, end) in enumerate(windows) if ((begin <= beyond) & (beyond <= end)).any()
    }
