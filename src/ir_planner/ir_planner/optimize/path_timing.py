"""Pace along a path that stays as it is: the fastest within speed, acceleration, jerk and torque, or the one
that serves the objective best.

The way s(t) along the path p(s) is chosen at the knots of a fine uniform cubic B-spline that passes p(s_k)
there. So energy and what exceeds a limit are those of SplineCost, and their derivatives by s_k follow by the
chain rule; L-BFGS goes down on all s_k and the duration in a metric in which the jerk of s counts. Between
its knots the spline leaves the path by little; by how much is measured. Points are then passed exactly by the
correction of least jerk, where that costs little time.
"""

from dataclasses import dataclass

import numpy as np
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from scipy.interpolate import make_interp_spline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.linalg.lapack import dtbtrs
from scipy.ndimage import convolve1d, maximum_filter1d

from ir_kernels import SplineCost, SplineTerms
from ir_planner.curves import UniformSpline
from ir_planner.optimize.fixed_path import FixedPath, knot_factor
from ir_planner.optimize.lbfgs import descend
from ir_planner.optimize.passing import Passing, jerk_bands
from ir_planner.optimize.refinement import within_limits
from ir_planner.request import Work
from ir_planner.scene import MotionLimits, PlanningScene, torque_use
from ir_planner.timing import objective_weights

_SPARSE = 40  # places of the path for the weight of an objective
_STEP = 0.1  # s between the knots of the coarsest spline
_FEWEST, _MOST = 12, 150  # its intervals
_STIFFNESS = (40.0, 40.0, 400.0)  # of penalties, against the objective's power; each with twice the knots
_EVALUATIONS = 250
_SLOWINGS = 12  # rounds, each where a limit is exceeded and
_AROUND = 4  # intervals around
_ENOUGH = 1.001  # use of a limit; what is left is slowed everywhere
_BENDING = 0.03  # weight of the jerk of s in the metric
_WAY, _TIME = 0.03, 0.1  # scales of s and of the duration's logarithm
_TOO_FAR, _HOPELESS = 100.0, 1e30
_TORQUE_SAMPLES = 6  # per interval
_WISHED_PACES = (0.98, 0.95, 0.9)  # room below the limits where the duration is wished, until it is kept
_ROUNDING = 1e-9  # relative
_LONGER = 1.03  # what passing points exactly may cost in time
_FAR = -1e3  # m: no pair is ever that near, so clearance costs nothing here
_EDGES_PER_INTERVAL = 0.25  # work of one evaluation, in certified edges


@dataclass(frozen=True, eq=False)
class Paced:
    """A motion along a path within the limits, and by how much it leaves the path [rad]."""

    trajectory: JointTrajectory
    deviation: float


def along_its_path(
    given: JointTrajectory,
    points: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    limits: MotionLimits,
    work: Work,
) -> Paced | None:
    """The path of a trajectory from rest to rest, at the best pace for the objective or in the wished
    duration; torque at samples, the proof comes after. None where no such pace is found.

    points (M, n) of the trajectory are passed exactly, unless that takes much longer: where they are dense.

    Raises CancelledError when asked to stop.
    """
    path = FixedPath(given, points)
    for pace in _WISHED_PACES if options.duration > 0.0 else (1.0,):
        found = _along(path, points, scene, options, limits, pace, work)
        if found is not None:
            spline, passing, way = found
            trajectory, exact = passing.sent(spline, given.joint_names)
            return Paced(trajectory, path.deviation(exact, way))
    return None


def _along(
    path: FixedPath,
    points: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    limits: MotionLimits,
    pace: float,
    work: Work,
) -> tuple[UniformSpline, Passing, FloatArray] | None:
    """The spline within the limits, what it passes exactly, and its places; None where it is too slow."""
    wished = options.duration
    total = wished or path.duration
    count = int(np.clip(np.ceil(total / _STEP), _FEWEST, _MOST))
    way = path.places(count)
    for k, stiffness in enumerate(_STIFFNESS):
        work.check()
        if k > 0 and work.exhausted:
            break
        if k > 0:
            way, count = path.finer(way), 2 * count
        descent = _Descent(path, scene, options, limits.for_speed(pace), stiffness, way, total)
        way, total, evaluations = descent.run(wished > 0.0)
        work.spend(int(np.ceil(evaluations * count * _EDGES_PER_INTERVAL)))
    way, total = _slowed_where_needed(path, way, total, limits, scene)
    spline = path.spline(way, total)
    near = within_limits(spline, limits, scene)
    passing = Passing.of(spline, path.knots_at_points(way), points)
    fitted = within_limits(passing.corrected(spline), limits, scene)
    if near is not None and (fitted is None or fitted.duration > _LONGER * near.duration):
        passing, fitted = Passing.nothing(points), near
    if fitted is not None and wished > 0.0:
        fitted = fitted.lasting(wished) if fitted.duration <= wished * (1.0 + _ROUNDING) else None
    return None if fitted is None else (fitted, passing, way)


class _Descent:
    """One descent on the places of all knots and on the duration."""

    def __init__(
        self,
        path: FixedPath,
        scene: PlanningScene,
        options: PlanOptions,
        limits: MotionLimits,
        stiffness: float,
        way: FloatArray,
        duration: float,
    ) -> None:
        self.path, self.way, self.duration = path, way, duration
        self.count = len(way) + 3
        weights = objective_weights(options, scene, path.q[::_SPARSE])
        robot = scene.cell.robot
        terms = SplineTerms(
            limits.velocity,
            limits.acceleration,
            limits.jerk,
            robot.position_min,
            robot.position_max,
            np.zeros(robot.n),  # the way is the same at every pace
            np.full((1, len(scene.collision.pairs)), _FAR),
            torque_share=limits.torque_share,
            energy_value=weights.energy,
            time_value=weights.time,
            capacity_energy=scene.dc_bus.capacity_energy,
            regeneration=scene.dc_bus.regeneration,
            penalty=stiffness * weights.power,
            clearance_penalty=0.0,
        )
        self.cost = SplineCost(scene.collision, scene.dynamics, terms)
        self.knots = knot_factor(len(way))
        self.root = _metric_root(len(way), _BENDING * self.count**3)

    def run(self, fixed: bool) -> tuple[FloatArray, float, int]:
        """Places (count - 3,), duration [s] and evaluations; `fixed`: the duration stays."""
        start = np.zeros(len(self.way) + 1)
        found, evaluations = descend(lambda x: self._value(x, fixed), start, _EVALUATIONS)
        way, duration = self._at(found)
        return way, duration, evaluations

    def _at(self, x: FloatArray) -> tuple[FloatArray, float]:
        way = self.way + _WAY * dtbtrs(self.root, x[:-1])[0]
        return np.clip(way, 0.0, 1.0), self.duration * float(np.exp(_TIME * x[-1]))

    def _value(self, x: FloatArray, fixed: bool) -> tuple[float, FloatArray]:
        if np.abs(x).max() > _TOO_FAR:  # a first step may overshoot
            return _HOPELESS, np.zeros_like(x)
        way, duration = self._at(x)
        spline = self.path.spline(way, duration)
        cost = self.cost.value(spline.control, spline.interval)
        by_knots = 6.0 * cho_solve_banded((self.knots, False), cost.gradient[3:-3])
        by_way = (by_knots * self.path.slope(way)).sum(axis=1)
        gradient = np.empty_like(x)
        gradient[:-1] = _WAY * dtbtrs(self.root, by_way, trans="T")[0]
        gradient[-1] = 0.0 if fixed else _TIME * duration * cost.of_interval / self.count
        return cost.value, gradient


def _slowed_where_needed(
    path: FixedPath, way: FloatArray, duration: float, limits: MotionLimits, scene: PlanningScene
) -> tuple[FloatArray, float]:
    """Places and duration with more time around the intervals in which a limit is exceeded: the best of some
    rounds.
    """
    window = np.hanning(2 * _AROUND + 3)[1:-1]
    knots = np.concatenate([[0], np.arange(2, len(way) + 2), [len(way) + 3]])
    best: tuple[float, FloatArray, float] | None = None
    for _ in range(_SLOWINGS):
        spline = path.spline(way, duration)
        use = _use(spline, limits, scene)
        whole = duration * max(float(use.max()), 1.0)
        if best is None or whole < best[0]:
            best = whole, way, duration
        if use.max() <= _ENOUGH:
            break
        widest = maximum_filter1d(np.maximum(use - 1.0, 0.0), 2 * _AROUND + 1)
        longer = 1.0 + convolve1d(widest, window / window.sum())
        times = np.concatenate([[0.0], np.cumsum(longer)])
        pace = make_interp_spline(times[knots], np.concatenate([[0.0], way, [1.0]]), k=3)
        slower = times[-1] / len(longer)
        duration *= slower
        way = np.clip(pace(np.arange(2, len(longer) - 1) * slower), 0.0, 1.0)
    assert best is not None  # of the first round
    return best[1:]


def _use(spline: UniformSpline, limits: MotionLimits, scene: PlanningScene) -> FloatArray:
    """By what factor each interval should be longer (S,)."""
    _, qd, qdd = spline.knots()
    torque = torque_use(scene.dynamics, *spline.samples(_TORQUE_SAMPLES)).max(axis=1)
    speed = (np.abs(qd) / limits.velocity).max(axis=1)
    acceleration = np.sqrt((np.abs(qdd) / limits.acceleration).max(axis=1))
    at_knots = np.maximum(speed, acceleration)
    jerk = np.abs(np.diff(qdd, axis=0)) / spline.interval / limits.jerk
    use: FloatArray = np.maximum.reduce(
        [
            np.maximum(at_knots[:-1], at_knots[1:]),
            np.cbrt(jerk.max(axis=1)),
            np.sqrt(torque.reshape(spline.intervals, -1).max(axis=1) / limits.torque_share),
        ]
    )
    return use


def _metric_root(count: int, weight: float) -> FloatArray:
    """U (4, count) in banded form, upper, with U' U = 1 + weight D' D, D the third differences."""
    return np.asarray(cholesky_banded(jerk_bands(count, weight, 1.0)))
