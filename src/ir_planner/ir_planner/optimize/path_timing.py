"""Time scaling of a path that stays as it is: the fastest within speed, acceleration, jerk and
torque, or the one that serves the objective best.

The path parameter s(t) along the path p(s) is chosen at the knots of a fine uniform cubic B-spline
that passes p(s_k) there. So energy and what exceeds a limit are those of SplineCost, and their
derivatives by s_k follow by the chain rule; L-BFGS optimises all s_k and the duration in a metric
in which the jerk of s counts. Between its knots the spline leaves the path by little; by how much
is measured. Points are then passed exactly by the correction of least jerk, where that costs little
time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ir_kernels import portable
from ir_kernels.spline import CubicPath
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import ToolUse
from ir_planner.curves import UniformSpline
from ir_planner.optimize.refinement import EDGES_PER_INTERVAL, SPEED_MARGINS
from ir_planner.optimize.spline_cost import slowed_to_limits, spline_cost
from ir_planner.request import Context
from ir_planner.scene import MotionLimits, PlanningScene, lasting_longer, torque_use
from ir_planner.timing import Movement, objective_weights, within_torque
from ir_values.arrays import FloatArray

_PLACES = 2000  # of the path, between which it is interpolated
_STANDING = 0.001  # share of the mean speed by which places part where the given motion stands
# of the distance between places: what is nearer to a point of the trajectory is left out
_APART = 0.3
_SAME = 1e-9  # rad
_FIRST = 0.125  # of the second control point's rise: the least of the first; 0.25 with an even jerk
_NEAREST = 8  # samples per interval for the deviation
_SPARSE = 40  # places of the path for the weight of an objective
_GAIN = 1e-5  # share of the value that ten steps must gain together


def _shares(knots: FloatArray) -> FloatArray:
    """Shares of a duration at which a path is sampled: the trajectory's own knots (N,), which it
    passes exactly, and even ones between that are not too near to these.
    """
    even = np.linspace(0.0, 1.0, _PLACES)
    after = np.searchsorted(knots, even)
    next_knot = knots[np.clip(after, 1, len(knots) - 1)]
    previous_knot = knots[np.clip(after - 1, 0, None)]
    near = np.minimum(np.abs(next_knot - even), np.abs(previous_knot - even))
    return np.sort(np.concatenate([knots, even[near > _APART / _PLACES]]))


class FixedPath:
    """p(s), s in [0, 1], from the points (N, n) that a trajectory passes."""

    def __init__(self, given: JointTrajectory, points: FloatArray) -> None:
        begin = float(given.times[0])
        span = given.duration - float(given.times[0])
        self.duration = span
        knots = (given.times - begin) / span
        self._share = _shares(knots)
        motion = given.sample(begin + self._share * span)
        q = motion.q
        q[0] = given.positions[0]
        q[-1] = given.positions[-1]

        # s grows with the length of the path, and a little with time: it does not stand still
        speed = np.linalg.norm(motion.qd, axis=1)
        density = speed + _STANDING * speed.mean()
        middle = 0.5 * (density[1:] + density[:-1])
        s = np.concatenate([[0.0], np.cumsum(middle * np.diff(self._share))])
        self._s = s / s[-1]
        self.q = q
        spline = portable.interpolating_spline(self._s, q)
        breaks = np.unique(spline.t)
        begins = breaks[:-1]
        cubics = [spline(begins), spline(begins, 1), spline(begins, 2) / 2, spline(begins, 3) / 6]
        self.cubics = CubicPath(breaks, np.stack(cubics))
        at_points = knots[_in_order(given.positions, points)]
        self._passed = np.interp(at_points, self._share, self._s)

    def at(self, s: FloatArray) -> FloatArray:
        """p (N, n) rad at s (N,) in [0, 1]."""
        breaks = self.cubics.breaks
        k = np.clip(np.searchsorted(breaks, s, side="right") - 1, 0, len(breaks) - 2)
        u = (s - breaks[k])[:, None]
        a, b, c, d = self.cubics.cubics[:, k]
        return np.asarray(a + u * (b + u * (c + u * d)))

    def places(self, count: int) -> FloatArray:
        """s at the inner knots (count - 3,) with the speed profile that was given."""
        return np.asarray(np.interp(np.linspace(0.0, 1.0, count + 1)[2:-2], self._share, self._s))

    def finer(self, s: FloatArray) -> FloatArray:
        """Path parameters (C,) of the same speed profile with a knot more in every interval."""
        knots = np.concatenate([[0.0], np.arange(2.0, len(s) + 2.0), [len(s) + 3.0]])
        profile = portable.interpolating_spline(knots, np.concatenate([[0.0], s, [1.0]]))
        return np.clip(profile(np.arange(2.0, 2.0 * len(s) + 5.0) / 2.0), 0.0, 1.0)

    def knots_at_points(self, s: FloatArray) -> FloatArray:
        """Where inner points are passed, in knots from the beginning (M - 2,); s (C,) at the inner
        knots.
        """
        rising = np.concatenate([[0.0], np.maximum.accumulate(s), [1.0]])
        knots = np.concatenate([[0.0], np.arange(2.0, len(s) + 2.0), [len(s) + 3.0]])
        return np.asarray(np.interp(self._passed[1:-1], rising, knots))

    def spline(self, s: FloatArray, duration: float) -> UniformSpline:
        """The spline that passes p(s), s (C,), at its inner knots, at rest at both ends, in
        `duration` [s].
        """
        inner = self.at(s)
        right = 6.0 * inner
        right[0] -= self.q[0]
        right[-1] -= self.q[-1]
        control = np.empty((len(inner) + 6, inner.shape[1]))
        control[:3] = self.q[0]
        control[-3:] = self.q[-1]
        control[3:-3] = from_knots(right)
        return UniformSpline(control, duration / (len(inner) + 3))

    def deviation(self, spline: UniformSpline, s: FloatArray) -> float:
        """Largest distance of the spline from the path [rad]: to its nearest configuration within
        two knots.
        """
        q = spline.samples(_NEAREST)[0]
        around = np.concatenate(
            [[0.0, 0.0], np.maximum.accumulate(np.clip(s, 0.0, 1.0)), [1.0, 1.0]]
        )
        k = np.arange(len(around) - 1)
        first = around[np.maximum(k - 1, 0)]
        last = around[np.minimum(k + 2, len(around) - 1)]
        near = self.at(np.linspace(first, last, 16 * _NEAREST, axis=1).ravel())
        near = near.reshape(len(k), 1, 16 * _NEAREST, -1)
        mine = q[: len(k) * _NEAREST].reshape(len(k), _NEAREST, 1, -1)
        away = np.zeros(1)
        for joint in range(
            q.shape[1]
        ):  # the largest of all joints, without an array of all of them
            away = np.maximum(away, np.abs(mine[..., joint] - near[..., joint]))
        return float(away.min(axis=2).max())


def from_knots(right: FloatArray) -> FloatArray:
    """The control points (C, n) whose values at their knots, times 6, are `right` (C, n); the
    matrix is symmetric.
    """
    bands = np.ones((2, len(right)))
    bands[1] = 4.0
    return portable.solve_banded(bands, right)


def never_back(s: FloatArray) -> FloatArray:
    """s (C,) at the inner knots of a spline over s from 0 to 1 that nowhere falls: as given where
    that is so, else with control points that rise, from the first interval on.
    """
    right = 6.0 * s
    right[-1] -= 1.0
    control = from_knots(right[:, None])[:, 0]
    rising = np.concatenate([[0.0], np.maximum.accumulate(np.clip(control, 0.0, 1.0)), [1.0]])
    if np.array_equal(rising[1:-1], control):
        return s
    rising[1] = max(rising[1], _FIRST * rising[2])
    rising[-2] = min(rising[-2], 1.0 - _FIRST * (1.0 - rising[-3]))
    return np.asarray((rising[:-2] + 4.0 * rising[1:-1] + rising[2:]) / 6.0)


def _in_order(positions: FloatArray, points: FloatArray) -> NDArray[np.int64]:
    """Indices (M,) at which `points` (M, n) are among `positions` (N, n), each after the one
    before; of a point that isn't among them that of the nearest one, which leaves some for the
    points after it.
    """
    indices = [0]
    for k, point in enumerate(points[1:-1], start=1):
        first = min(indices[-1] + 1, len(positions) - 1)
        away = np.abs(
            positions[first : max(len(positions) - len(points) + 1 + k, first + 1)] - point
        )
        here = np.flatnonzero(away.max(axis=1) < _SAME)
        indices.append(first + int(here[0] if len(here) else np.argmin(away.max(axis=1))))
    return np.array([*indices, len(positions) - 1])


def optimised_profile(
    path: FixedPath,
    s: FloatArray,
    duration: float,
    limits: MotionLimits,
    effort: tuple[float, float, int],
    context: Context,
) -> tuple[FloatArray, float, int]:
    """s (count - 3,) at the inner knots, duration [s] and evaluations, from a profile s and its
    duration, which stays where the request has one. effort: stiffness of penalties, against the
    power that the objective is about, smoothing of the DC link [W], and evaluations.
    """
    weights = objective_weights(context, path.q[::_SPARSE])
    stiffness, smoothing, most = effort
    cost = spline_cost(context, limits, weights, stiffness * weights.power, smoothing=smoothing)
    descent = cost.descend_profile(
        path.cubics,
        s,
        duration,
        fixed_duration=context.options.duration > 0.0,
        evaluations=most,
        tolerance=_GAIN,
    )
    return descent.s, descent.duration, descent.evaluations


# Points that a spline passes exactly, by the correction of its control points of least jerk.

_KNOT = 0.02  # intervals: what is nearer to a knot is passed there
_PER_POINT = 2.0  # control points that each point must have to itself
_LITTLE = 1e-9  # weight of the size of a correction beside its jerk
_STEPS = 3  # of Newton's towards the nearest place


class Passing(NamedTuple):
    """points (P, n) are passed `at` (P,), in knots from the beginning; none where they were too
    dense.
    """

    at: FloatArray
    points: FloatArray

    @staticmethod
    def nothing(points: FloatArray) -> "Passing":
        """For points (M, n) of which none needs to be passed."""
        return Passing(np.zeros(0), points[:0])

    @staticmethod
    def of(spline: UniformSpline, near: FloatArray, points: FloatArray) -> "Passing":
        """Where a spline comes nearest to the inner points of `points` (M, n); near (M - 2,): about
        there.
        """
        inner = points[1:-1]
        if len(inner) == 0 or len(spline.control) - 6 < _PER_POINT * len(inner):
            return Passing.nothing(points)
        at = np.clip(near, 1.0, spline.intervals - 1.0)
        for _ in range(_STEPS):
            q, slope = _values(spline.control, at)
            speed = np.maximum((slope * slope).sum(axis=1), 1e-12)
            step = ((inner - q) * slope).sum(axis=1) / speed
            at = np.clip(at + np.clip(step, -0.5, 0.5), 1.0, spline.intervals - 1.0)
        whole = np.rint(at)
        at = np.where(np.abs(at - whole) < _KNOT, whole, at)
        if np.diff(at).min(initial=1.0) < _KNOT:
            return Passing.nothing(points)
        return Passing(at, inner)

    def corrected(self, spline: UniformSpline) -> UniformSpline:
        """The spline through the points; its ends stay."""
        if len(self.at) == 0:
            return spline
        count = len(spline.control)
        rows = _basis(self.at, count)[:, 3:-3]
        spread = portable.solve_banded(jerk_bands(count, 1.0, _LITTLE)[:, 3:-3], rows.T)
        missing = self.points - _values(spline.control, self.at)[0]
        control = spline.control.copy()
        pull = portable.least_squares(portable.matmul(rows, spread), missing)
        control[3:-3] += portable.matmul(spread, pull)
        return UniformSpline(control, spline.interval)

    def sent(
        self, spline: UniformSpline, joint_names: tuple[str, ...]
    ) -> tuple[JointTrajectory, UniformSpline]:
        """The motion with a point wherever one is passed beside a knot, and its spline: corrected
        for the nanoseconds that these times have.
        """
        step = int(np.ceil(spline.interval * 1e9 - 1e-3))
        times = np.rint(self.at * step).astype(np.int64)
        exact = Passing(times / step, self.points).corrected(
            UniformSpline(spline.control, step * 1e-9)
        )
        q, qd, qdd = exact.knots()
        knots = np.arange(len(q), dtype=np.int64) * step
        between = times[times % step != 0]
        k = between // step
        after = ((between % step) * 1e-9)[:, None]
        jerk = (qdd[k + 1] - qdd[k]) / exact.interval
        more = (
            q[k] + after * (qd[k] + after * (qdd[k] / 2.0 + after * jerk / 6.0)),
            qd[k] + after * (qdd[k] + after * jerk / 2.0),
            qdd[k] + after * jerk,
        )
        order = np.argsort(np.concatenate([knots, between]), kind="stable")
        values = (np.concatenate(pair)[order] for pair in zip((q, qd, qdd), more, strict=True))
        return JointTrajectory(joint_names, np.concatenate([knots, between])[order], *values), exact


def _basis(at: FloatArray, count: int) -> FloatArray:
    """Weights (P, count) of the control points where `at` (P,) knots have gone by."""
    k = np.clip(np.floor(at).astype(int), 0, count - 4)
    u = at - k
    cube = (u * u) * u
    weights = (
        (1 - u) ** 2 * (1 - u),
        3 * cube - 6 * (u * u) + 4,
        -3 * cube + 3 * (u * u) + 3 * u + 1,
        cube,
    )
    rows = np.zeros((len(at), count))
    for i, weight in enumerate(weights):
        rows[np.arange(len(at)), k + i] = weight / 6.0
    return rows


def _values(control: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (P, n), and slopes per knot."""
    k = np.clip(np.floor(at).astype(int), 0, len(control) - 4)
    u = (at - k)[:, None]
    c = [control[k + i] for i in range(4)]
    slope = (
        -((1 - u) ** 2) * c[0]
        + (3 * (u * u) - 4 * u) * c[1]
        + (-3 * (u * u) + 2 * u + 1) * c[2]
        + (u * u) * c[3]
    ) / 2.0
    return portable.matmul(_basis(at, len(control)), control), slope


def jerk_bands(count: int, weight: float, size: float) -> FloatArray:
    """size + weight D' D with the third differences D of `count` values, (4, count) in banded form,
    upper.
    """
    third = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((4, count))
    for i in range(4):
        for j in range(i, 4):
            bands[3 - (j - i), j : count - 3 + j] += weight * third[i] * third[j]
    bands[3] += size
    return bands


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


class TimingEffort(NamedTuple):
    """Evaluations of the cost per descent; in each the stiffness of the penalties, against the
    objective's power, and the W over which the DC link's switch is rounded. Each has twice the
    knots of the one before.
    """

    evaluations: int
    descents: tuple[tuple[float, float], ...]


# Service lines of the bundled cells: not more J than with the thorough effort, in two thirds of the
# time.
QUICK_TIMING = TimingEffort(250, ((40.0, 100.0), (400.0, 5.0)))
THOROUGH_TIMING = TimingEffort(250, ((40.0, 100.0), (40.0, 20.0), (400.0, 3.0)))


class PathTiming(NamedTuple):
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
        timed = _spline_within_limits(path, points, (limits, speed), effort, context)
        if timed is not None:
            spline, passing, s = timed
            trajectory, exact = passing.sent(spline, given.joint_names)
            return PathTiming(trajectory, path.deviation(exact, s))
    return None


def _spline_within_limits(
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
    from scipy.ndimage import convolve1d, maximum_filter1d

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
        profile = portable.interpolating_spline(times[knots], np.concatenate([[0.0], s, [1.0]]))
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
    use = lasting_longer(limits, speed, acceleration, jerk, torque.reshape(shape).max(axis=1))
    if not limits.tool.asked:
        return use
    trajectory = spline.trajectory(scene.cell.robot.joint_names)
    return np.maximum(use, ToolUse(trajectory, scene, limits.tool).longer)


KEPT = 1e-3  # rad by which a time scaling may leave its path: some millimetres of the tool at most


def rescaled(
    movement: Movement, context: Context, effort: TimingEffort = THOROUGH_TIMING
) -> Movement | None:
    """The certified movement with the best time scaling along a movement's path; None where there
    is none, or no work left for it. Raises CancelledError when asked to stop.
    """

    def along(limits: MotionLimits) -> Movement | None:
        if context.work.exhausted:
            return None
        timed = along_its_path(movement.trajectory, movement.path, limits, context, effort)
        if timed is None or timed.deviation > KEPT:
            context.journal.reject("no better time scaling along the path")
            return None
        note = f"within {timed.deviation * 1e3:.2f} mrad of its path"
        return Movement(movement.path, timed.trajectory, context, note)

    timed = within_torque(along, context)
    violation = None if timed is None else timed.prove().violation
    if violation is not None:
        context.journal.reject(f"a time scaling along the path isn't certified: {violation.what}")
        return None
    return timed
