"""The time along one stroke of a path, from rest to rest: the tool's speed as asked for where the axes can
follow; within the tolerance slower where they can't, else refused with the place and the axis.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.ndimage import convolve1d, maximum_filter1d

from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.joint_curve import JointCurve, singularity
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.speed_law import Span, SpeedLaw, TooShortError, law_of, ramp_places
from ir_planner.scene import MotionLimits, PlanningScene, torque_use
from ir_planner.timing import lasting_longer

_RAMPS = np.geomspace(0.01, 10.0, 13)  # s
_FINER, _ZOOMS, _PER_RAMP = 8, 3, 13
_USED = 0.97  # of a limit: the interpolant between points needs a little more than the samples
_STEP_S, _SAMPLES_MIN, _SAMPLES_MAX = 4e-3, 200, 6000
_WARP_S, _WARP_MIN, _WARP_MAX = 0.02, 60, 1500  # of the slowness' knots
_ROUNDS, _AROUND = 25, 4
_ENOUGH = 1.0 + 1e-4
_SLOWER = 0.85
_SHOWN = 0.95  # of the tolerance: what is shown of the speed is a bound, a little above what it is at samples
_SLOWEST = 1e-4  # m/s


@dataclass(frozen=True, eq=False)
class Driven:
    """Motion at M instants: t (M,) s, s (M,) m along the path, speed (M,) m/s; q, qd, qdd, qddd (M, n)."""

    t: FloatArray
    s: FloatArray
    speed: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    qddd: FloatArray


@dataclass(frozen=True, eq=False)
class TimedStroke:
    """A curve of the axes with its law; slowness: by how much longer each instant of the law takes, None:
    1.
    """

    curve: JointCurve
    law: SpeedLaw
    slowness: BSpline | None = None

    @cached_property
    def _longer(self) -> BSpline | None:
        return None if self.slowness is None else self.slowness.antiderivative()

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.at(np.array([self.law.total])).t[0])

    def at(self, tau: FloatArray) -> Driven:
        """The motion at instants tau (M,) s of the law."""
        s, v, a, j = self.law.at(tau)
        t = tau
        if self.slowness is not None and self._longer is not None:
            t = self._longer(tau) - self._longer(0.0)
            g = 1.0 / self.slowness(tau)
            g1 = -self.slowness(tau, nu=1) * g**2  # by tau
            g2 = -self.slowness(tau, nu=2) * g**2 + 2.0 * self.slowness(tau, nu=1) ** 2 * g**3
            first, second, third = g, g * g1, g * g1**2 + g**2 * g2
            v, a, j = (
                v * first,
                a * first**2 + v * second,
                j * first**3 + 3.0 * a * first * second + v * third,
            )
        return driven(self.curve, t, self.curve.begin + s, v, a, j)


def driven(
    curve: JointCurve, t: FloatArray, s: FloatArray, v: FloatArray, a: FloatArray, j: FloatArray
) -> Driven:
    """The axes at s (M,) with speed, acceleration and jerk (M,) along the path."""
    along = curve.at(np.clip(s, curve.begin, curve.end))
    return _with_speed(along, t, s, v, a, j)


def _with_speed(
    along: tuple[FloatArray, ...], t: FloatArray, s: FloatArray, v: FloatArray, a: FloatArray, j: FloatArray
) -> Driven:
    """The same from q and its derivatives by s (M, n)."""
    q, first, second, third = along
    v1, a1, j1 = v[:, None], a[:, None], j[:, None]
    qd = first * v1
    qdd = second * v1**2 + first * a1
    qddd = third * v1**3 + 3.0 * second * v1 * a1 + first * j1
    return Driven(t, s, v, q, qd, qdd, qddd)


def use_of(motion: Driven, limits: MotionLimits, scene: PlanningScene) -> FloatArray:
    """By what factor (M,) a motion would have to last longer; at most 1: within the limits."""
    torque = torque_use(scene.dynamics, motion.q, motion.qd, motion.qdd)
    return lasting_longer(limits, np.abs(motion.qd), np.abs(motion.qdd), np.abs(motion.qddd), torque)


def timed_stroke(
    curve: JointCurve,
    spans: tuple[Span, ...],
    tolerance: float,
    limits: MotionLimits,
    scene: PlanningScene,
) -> TimedStroke:
    """The stroke from rest to rest within the limits. Raises PathRefusedError with place and axis."""
    slow = True
    while True:
        ramps = np.array([_ramp(curve, spans, k, limits, scene, slow) for k in range(len(spans) + 1)])
        try:
            made = TimedStroke(curve, law_of(spans, ramps))
            break
        except TooShortError as error:
            spans = spans if slow else _slower(spans, error, tolerance, ramps)
            slow = False
    tau = _instants(made.law)
    if use_of(made.at(tau), limits, scene).max() <= _ENOUGH:
        return made
    return _slowed(made, tolerance, limits, scene)


def _slower(
    spans: tuple[Span, ...], error: TooShortError, tolerance: float, ramps: FloatArray
) -> tuple[Span, ...]:
    """The spans with a lower speed where one is too short for it, if it may be lower."""
    k = error.index
    span = spans[k]
    if (span.kept and tolerance < 1.0) or span.speed < _SLOWEST:
        raise PathRefusedError(
            f"a part of the path is {span.length:.4g} m long: reaching {span.speed:g} m/s and braking take "
            f"{span.length + error.missing:.4g} m; a lower tool_speed, or speed_tolerance 1, may help",
            StatusCode.INVALID_MOTION_PLAN,
        )
    return (*spans[:k], replace(span, speed=span.speed * _SLOWER), *spans[k + 1 :])


def _instants(law: SpeedLaw) -> FloatArray:
    count = int(np.clip(law.total / _STEP_S, _SAMPLES_MIN, _SAMPLES_MAX))
    share = np.linspace(0.0, 1.0, _PER_RAMP)
    inner = (law.times[:-1, None] + share * law.duration[:, None]).ravel()
    return np.unique(np.concatenate([np.linspace(0.0, law.total, count), inner]))


def _ramp(
    curve: JointCurve,
    spans: tuple[Span, ...],
    k: int,
    limits: MotionLimits,
    scene: PlanningScene,
    slow: bool,
) -> float:
    """The shortest ramp [s] between the speeds at boundary k that needs no more of the limits than the
    constant speed beside it does. slow: where that is too much, one that keeps them, if there is one; a path
    that begins near a singularity is driven slowly there.
    """
    _, first, last = ramp_places(spans, k, _RAMPS[:1])
    if first == last:
        return 0.0

    def use(durations: FloatArray) -> tuple[FloatArray, FloatArray]:
        return _ramps_use(curve, spans, k, durations, limits, scene)

    found = _shortest(lambda durations: np.less_equal(*_beside(*use(durations))))
    if slow and use(np.array([found]))[0][0] > _ENOUGH:
        longer = _shortest(lambda durations: use(durations)[0] <= _USED)
        if use(np.array([longer]))[0][0] <= _ENOUGH:
            return longer
    return found


def _shortest(fits_of: Callable[[FloatArray], BoolArray]) -> float:
    """The shortest duration [s] that fits, the longest where none does."""
    durations = _RAMPS
    for _ in range(_ZOOMS):
        fits = fits_of(durations)
        d = int(np.argmax(fits)) if fits.any() else len(fits) - 1
        low = durations[max(d - 1, 0)]
        durations, found = np.linspace(low, durations[d], _FINER), float(durations[d])
    return found


def _beside(ramp: FloatArray, cruise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What ramps (R,) need, and what they may."""
    return ramp, np.maximum(_USED, cruise)


def _ramps_use(
    curve: JointCurve,
    spans: tuple[Span, ...],
    k: int,
    durations: FloatArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> tuple[FloatArray, FloatArray]:
    """What ramps of these durations (R,) s need of the limits (R,), and the constant speed there (R,)."""
    begin, first, last = ramp_places(spans, k, durations)
    x, T = np.linspace(0.0, 1.0, _PER_RAMP), durations[:, None]
    rise = last - first
    s = curve.begin + begin[:, None] + T * x * (first + rise * x**2 * (1.0 - 0.5 * x))
    v = np.broadcast_to(first + rise * x**2 * (3.0 - 2.0 * x), s.shape)
    a, j = rise / T * 6.0 * x * (1.0 - x), rise / T**2 * (6.0 - 12.0 * x)
    none, places = np.zeros(s.size), s.ravel()
    even = np.full(s.size, max(first, last))
    along = curve.at(np.clip(places, curve.begin, curve.end))
    ramp = use_of(_with_speed(along, none, places, v.ravel(), a.ravel(), j.ravel()), limits, scene)
    cruise = use_of(_with_speed(along, none, places, even, none, none), limits, scene)
    return ramp.reshape(s.shape).max(axis=1), cruise.reshape(s.shape).max(axis=1)


def _slowed(made: TimedStroke, tolerance: float, limits: MotionLimits, scene: PlanningScene) -> TimedStroke:
    """The stroke with more time where a limit is exceeded, as far as the tolerance allows."""
    law = made.law
    most = np.inf if tolerance >= 1.0 else 1.0 / (1.0 - _SHOWN * tolerance)
    knots = np.linspace(0.0, law.total, int(np.clip(law.total / _WARP_S, _WARP_MIN, _WARP_MAX)))
    slowness = np.ones(len(knots))
    window = np.hanning(2 * _AROUND + 3)[1:-1]
    tau = np.unique(np.concatenate([_instants(law), knots]))
    owner = np.clip(np.searchsorted(knots, tau), 0, len(knots) - 1)
    begun = made.at(tau)
    if use_of(begun, limits, scene).max() > most * 1.5:
        raise _refused(made, begun, limits, scene, tolerance)
    for _ in range(_ROUNDS):
        slowed = replace(made, slowness=make_interp_spline(knots, slowness, k=5))
        use = use_of(slowed.at(tau), limits, scene)
        if use.max() <= _ENOUGH:
            return slowed
        at_knots = np.ones(len(knots))
        np.maximum.at(at_knots, owner, use)
        widest = maximum_filter1d(np.maximum(at_knots * 1.002 - 1.0, 0.0), 2 * _AROUND + 1)
        slowness = slowness * (1.0 + convolve1d(widest, window / window.sum(), mode="nearest"))
        if slowness.max() > most:
            break
    raise _refused(made, begun, limits, scene, tolerance)


def _refused(
    made: TimedStroke, motion: Driven, limits: MotionLimits, scene: PlanningScene, tolerance: float
) -> PathRefusedError:
    """Why the speed can't be kept: the worst place, its axis and what it lacks."""
    factor = use_of(motion, limits, scene)
    k = int(np.argmax(factor))
    torque = torque_use(scene.dynamics, motion.q[k : k + 1], motion.qd[k : k + 1], motion.qdd[k : k + 1])[0]
    shares = {
        "velocity": np.abs(motion.qd[k]) / limits.velocity,
        "acceleration": np.abs(motion.qdd[k]) / limits.acceleration,
        "jerk": np.abs(motion.qddd[k]) / limits.jerk,
        "torque": torque / limits.torque_share,
    }
    powers = {"velocity": 1.0, "acceleration": 0.5, "jerk": 1.0 / 3.0, "torque": 0.5}
    what = max(shares, key=lambda name: float(shares[name].max() ** powers[name]))
    j = int(np.argmax(shares[what]))
    speed = motion.speed[k]
    slowest = f"; there it could do about {speed / factor[k]:.3g} m/s" if speed > 0.0 else ""
    return PathRefusedError(
        f"{scene.cell.robot.joint_names[j]} needs {shares[what][j]:.2f} times its {what} limit at "
        f"{motion.s[k]:.3f} m, where the tool moves at {speed:.3g} m/s"
        f"{singularity(motion.q[k], scene)}{slowest}; speed_tolerance is {tolerance:g}",
        StatusCode.INVALID_MOTION_PLAN,
    )
