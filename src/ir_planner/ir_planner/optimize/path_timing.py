"""Time scaling of a path that stays as it is: the fastest within speed, acceleration, jerk and
torque, or the one that serves the objective best.

The path parameter s(t) along the path p(s) is chosen at the knots of a fine uniform cubic B-spline
that passes p(s_k) there. So energy and what exceeds a limit are those of SplineCost, and their
derivatives by s_k follow by the chain rule; L-BFGS optimises all s_k and the duration in a metric
in which the jerk of s counts. Between its knots the spline leaves the path by little; by how much
is measured. Points are then passed exactly by the correction of least jerk, where that costs little
time.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import convolve1d, maximum_filter1d

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import UniformSpline
from ir_planner.optimize.fixed_path import FixedPath, never_back
from ir_planner.optimize.passing import Passing
from ir_planner.optimize.profile_descent import optimised_profile
from ir_planner.optimize.refinement import EDGES_PER_INTERVAL, SPEED_MARGINS
from ir_planner.optimize.spline_cost import slowed_to_limits
from ir_planner.request import Context
from ir_planner.scene import MotionLimits, PlanningScene, torque_use
from ir_planner.timing import lasting_longer

_STEP = 0.1  # s between the knots of the coarsest spline
# its intervals
_FEWEST = 12
_MOST = 150
_SLOWINGS = 12  # rounds, each where a limit is exceeded and
_AROUND = 4  # intervals around
_ENOUGH = 1.001  # use of a limit; what is left is slowed everywhere
_TORQUE_SAMPLES = 6  # per interval
_ROUNDING = 1e-9  # relative
_LONGER = 1.03  # what passing points exactly may cost in time


@dataclass(frozen=True)
class TimingEffort:
    """Evaluations of the cost per descent; in each the stiffness of the penalties, against the
    objective's power, and the W over which the bus' switch is rounded. Each has twice the knots of
    the one before.
    """

    evaluations: int
    descents: tuple[tuple[float, float], ...]


# service lines of the bundled cells: not more J than with the thorough effort, in two thirds of the
# time
QUICK_TIMING = TimingEffort(250, ((40.0, 100.0), (400.0, 5.0)))
THOROUGH_TIMING = TimingEffort(250, ((40.0, 100.0), (40.0, 20.0), (400.0, 3.0)))


@dataclass(frozen=True, eq=False)
class PathTiming:
    """A motion along a path within the limits, and by how much it leaves the path [rad]."""

    trajectory: JointTrajectory
    deviation: float


def along_its_path(
    given: JointTrajectory,
    points: FloatArray,
    limits: MotionLimits,
    context: Context,
    effort: TimingEffort = THOROUGH_TIMING,
) -> PathTiming | None:
    """The path of a trajectory from rest to rest with the best time scaling for the objective, or
    in the requested duration; torque at samples, the proof comes after. None where none is found.

    points (M, n) of the trajectory are passed exactly, unless that takes much longer: where they
    are dense.

    Raises CancelledError when asked to stop.
    """
    path = FixedPath(given, points)
    for speed in SPEED_MARGINS if context.options.duration > 0.0 else (1.0,):
        found = _along(path, points, (limits, speed), effort, context)
        if found is not None:
            spline, passing, s = found
            trajectory, exact = passing.sent(spline, given.joint_names)
            return PathTiming(trajectory, path.deviation(exact, s))
    return None


def _along(
    path: FixedPath,
    points: FloatArray,
    bounds: tuple[MotionLimits, float],
    effort: TimingEffort,
    context: Context,
) -> tuple[UniformSpline, Passing, FloatArray] | None:
    """The spline within the limits, what it passes exactly, and s at its knots; None where it is
    too slow.
    """
    requested = context.options.duration
    scene = context.scene
    limits, speed = bounds
    s, total = _profile(path, limits.for_speed(speed), effort, context)
    s, total = _slowed_where_needed(path, s, total, limits, scene)
    spline = path.spline(s, total)
    near = slowed_to_limits(spline, limits, scene)
    passing = Passing.of(spline, path.knots_at_points(s), points)
    fitted = slowed_to_limits(passing.corrected(spline), limits, scene)
    if near is not None and (fitted is None or fitted.duration > _LONGER * near.duration):
        passing = Passing.nothing(points)
        fitted = near
    if fitted is not None and requested > 0.0:
        fitted = (
            fitted.lasting(requested) if fitted.duration <= requested * (1.0 + _ROUNDING) else None
        )
    return None if fitted is None else (fitted, passing, s)


def _profile(
    path: FixedPath, limits: MotionLimits, effort: TimingEffort, context: Context
) -> tuple[FloatArray, float]:
    """s at the inner knots of the finest spline, and the duration [s], by descents on finer
    ones.
    """
    total = context.options.duration or path.duration
    count = int(np.clip(np.ceil(total / _STEP), _FEWEST, _MOST))
    s = path.places(count)
    for k, (stiffness, smoothing) in enumerate(effort.descents):
        context.work.check()
        finer = 2 * count if k > 0 else count
        most = min(effort.evaluations, int(context.work.left / (EDGES_PER_INTERVAL * finer)))
        if most < 1 or context.work.exhausted:
            break
        if k > 0:
            s = path.finer(s)
            count = finer
        s, total, evaluations = optimised_profile(
            path, s, total, limits, (stiffness, smoothing, most), context
        )
        context.work.spend(int(np.ceil(evaluations * count * EDGES_PER_INTERVAL)))
    return never_back(s), total


def _slowed_where_needed(
    path: FixedPath, s: FloatArray, duration: float, limits: MotionLimits, scene: PlanningScene
) -> tuple[FloatArray, float]:
    """s and duration with more time around the intervals in which a limit is exceeded: the best of
    some rounds.
    """
    window = np.hanning(2 * _AROUND + 3)[1:-1]
    knots = np.concatenate([[0], np.arange(2, len(s) + 2), [len(s) + 3]])
    best: tuple[float, FloatArray, float] | None = None
    for _ in range(_SLOWINGS):
        spline = path.spline(s, duration)
        use = _use(spline, limits, scene)
        whole = duration * max(float(use.max()), 1.0)
        if best is None or whole < best[0]:
            best = whole, s, duration
        if use.max() <= _ENOUGH:
            break
        widest = maximum_filter1d(np.maximum(use - 1.0, 0.0), 2 * _AROUND + 1)
        longer = 1.0 + convolve1d(widest, window / window.sum())
        times = np.concatenate([[0.0], np.cumsum(longer)])
        profile = make_interp_spline(times[knots], np.concatenate([[0.0], s, [1.0]]), k=3)
        slower = times[-1] / len(longer)
        duration *= slower
        s = never_back(np.clip(profile(np.arange(2, len(longer) - 1) * slower), 0.0, 1.0))
    assert best is not None  # of the first round
    return best[1:]


def _use(spline: UniformSpline, limits: MotionLimits, scene: PlanningScene) -> FloatArray:
    """By what factor each interval should be longer (S,)."""
    _, qd, qdd = spline.knots()
    torque = torque_use(scene.dynamics, *spline.samples(_TORQUE_SAMPLES))
    speed, acceleration = (np.maximum(np.abs(x[:-1]), np.abs(x[1:])) for x in (qd, qdd))
    jerk = np.abs(np.diff(qdd, axis=0)) / spline.interval
    shape = (spline.intervals, _TORQUE_SAMPLES, -1)
    return lasting_longer(limits, speed, acceleration, jerk, torque.reshape(shape).max(axis=1))
