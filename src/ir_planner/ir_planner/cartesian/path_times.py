"""Times along one stroke of a path, and the trajectory that is sent."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ir_kernels import portable
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import NS_PER_S, JointTrajectory
from ir_planner.cartesian.joint_curve import JointCurve, singularity
from ir_planner.cartesian.speed_ramps import (
    ENOUGH,
    PER_RAMP,
    USED,
    DrivenMotion,
    SpeedLaw,
    StrokeSpan,
    TooShortError,
    driven,
    law_of,
    ramps_of,
    use_of,
)
from ir_planner.cartesian.tool_path import PathRefusedError
from ir_planner.scene import MotionLimits, PlanningScene, torque_use
from ir_values.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

# The time along one stroke of a path, from rest to rest: the tool's speed as asked for where the
# axes can follow; within the tolerance slower where they can't, else refused with the place and the
# axis.

_STEP_S = 4e-3
_SAMPLES_MIN = 200
_SAMPLES_MAX = 6000
# of the slowness' knots
_WARP_S = 0.02
_WARP_MIN = 60
_WARP_MAX = 1500
_ROUNDS = 25
_AROUND = 4
_USED_AT_MOST = 0.995  # of a limit, by ramps that are too long for their part otherwise
# of a ramp
_GROWTH = 1.2
_GROWTHS = 30
_SLOWER = 0.85
_SHORTER = 0.999  # of ramps that would just fit
# of the tolerance: what is shown of the speed is a bound, a little above what it is at samples
_SHOWN = 0.95
_SLOWEST = 1e-4  # m/s


@dataclass(frozen=True, eq=False)
class TimedStroke:
    """A curve of the axes with its law; slowness: by how much longer each instant of the law takes,
    None:
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

    def stretched(self, factor: float) -> TimedStroke:
        """The stroke, slower by `factor`."""
        law = self.law
        slower = SpeedLaw(law.duration * factor, law.first / factor, law.last / factor, law.even)
        if self.slowness is None:
            return replace(self, law=slower)
        from scipy.interpolate import BSpline

        spline = self.slowness
        return replace(self, law=slower, slowness=BSpline(spline.t * factor, spline.c, spline.k))

    def at(self, tau: FloatArray) -> DrivenMotion:
        """The motion at instants tau (M,) s of the law."""
        s, v, a, j = self.law.at(tau)
        t = tau
        if self.slowness is not None and self._longer is not None:
            t = self._longer(tau) - self._longer(0.0)
            g = 1.0 / self.slowness(tau)
            g1 = -self.slowness(tau, nu=1) * (g * g)  # by tau
            g2 = -self.slowness(tau, nu=2) * (g * g) + 2.0 * self.slowness(
                tau, nu=1
            ) ** 2 * portable.power(g, 3)
            first = g
            second = g * g1
            third = g * (g1 * g1) + (g * g) * g2
            v, a, j = (
                v * first,
                a * (first * first) + v * second,
                j * portable.power(first, 3) + 3.0 * a * first * second + v * third,
            )
        return driven(self.curve, t, self.curve.begin + s, v, a, j)


def timed_stroke(
    curve: JointCurve,
    spans: tuple[StrokeSpan, ...],
    tolerance: float,
    limits: MotionLimits,
    scene: PlanningScene,
    *,
    longer: bool = False,
) -> TimedStroke:
    """The stroke from rest to rest within the limits. Raises PathRefusedError with place and axis.

    longer: where it would be refused, ramps reach as far along the path as it takes.
    """
    spans, ramps = fitting(curve, spans, tolerance, limits, scene)
    made = TimedStroke(curve, law_of(spans, ramps))
    if use_of(made.at(instants(made.law)), limits, scene).max() <= ENOUGH:
        return made
    try:
        return _stroke_within_limits(made, tolerance, limits, scene)
    except PathRefusedError:
        grown = _grown(made, spans, ramps, limits, scene) if longer else None
        if grown is None:
            raise
        return grown


def fitting(
    curve: JointCurve,
    spans: tuple[StrokeSpan, ...],
    tolerance: float,
    limits: MotionLimits,
    scene: PlanningScene,
) -> tuple[tuple[StrokeSpan, ...], FloatArray]:
    """The K spans, slower within `tolerance` (a share of the speed) where need be, and ramps
    (K + 1,) [s] between their speeds that fit into them. Raises PathRefusedError where none do.
    """
    for slow, used in ((True, USED), (True, _USED_AT_MOST)):
        ramps = ramps_of(curve, spans, limits, scene, slow=slow, used=used)
        with suppress(TooShortError):
            law_of(spans, ramps)
            return spans, ramps
    while True:
        ramps = ramps_of(curve, spans, limits, scene, slow=False)
        try:
            law_of(spans, ramps)
            return spans, ramps
        except TooShortError as error:
            slower = _spans_with_lower_speed(spans, error, tolerance)
            if slower is None:
                raise _too_short(curve, spans, ramps, error, limits, scene) from error
            spans = slower


def _grown(
    made: TimedStroke,
    spans: tuple[StrokeSpan, ...],
    ramps: FloatArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> TimedStroke | None:
    """The stroke with longer ramps to the ends that are nearest to where it exceeds the limits;
    None where they don't fit.
    """
    ends = np.concatenate([[0.0], np.cumsum([span.length for span in spans])])
    speeds = np.array([0.0, *(span.speed for span in spans), 0.0])
    for _ in range(_GROWTHS):
        motion = made.at(instants(made.law))
        use = use_of(motion, limits, scene)
        if use.max() <= ENOUGH:
            return made
        away = np.abs(ends - (motion.s[int(np.argmax(use))] - made.curve.begin))
        k = int(np.argmin(away))
        reaching = 2.0 * float(away[k]) / (speeds[k] + speeds[k + 1])
        ramps = np.where(np.arange(len(ramps)) == k, np.maximum(_GROWTH * ramps, reaching), ramps)
        try:
            made = replace(made, law=law_of(spans, ramps))
        except TooShortError:
            return None
    return None


def _spans_with_lower_speed(
    spans: tuple[StrokeSpan, ...], error: TooShortError, tolerance: float
) -> tuple[StrokeSpan, ...] | None:
    """The spans with a lower speed where one is too short for it; None where it may not be
    lower.
    """
    k = error.index
    span = spans[k]
    if (span.kept and tolerance < 1.0) or span.speed < _SLOWEST:
        return None
    return (*spans[:k], replace(span, speed=span.speed * _SLOWER), *spans[k + 1 :])


def _too_short(
    curve: JointCurve,
    spans: tuple[StrokeSpan, ...],
    ramps: FloatArray,
    error: TooShortError,
    limits: MotionLimits,
    scene: PlanningScene,
) -> PathRefusedError:
    """Why a span can't be driven at its speed: where it lies, and the axis that lacks something."""
    k = error.index
    span = spans[error.index]
    begin = curve.begin + sum(one.length for one in spans[:k])
    fits = span.length / (span.length + error.missing)
    axis = ""
    with suppress(TooShortError):  # elsewhere: then no axis is named
        law = law_of(spans, ramps * fits * _SHORTER)
        motion = TimedStroke(curve, law).at(instants(law))
        at = int(np.argmax(use_of(motion, limits, scene)))
        worst = _worst(motion, at, limits, scene)
        axis = f"; with shorter ramps {worst} at {motion.s[at]:.3f} m"
    return PathRefusedError(
        f"a part of the path, from {begin:.3f} to {begin + span.length:.3f} m, is "
        f"{span.length:.4g} m long: reaching {span.speed:g} m/s and braking take "
        f"{span.length + error.missing:.4g} m{axis}; a tool_speed of about "
        f"{span.speed * fits ** (2.0 / 3.0):.2g} m/s, or speed_tolerance 1, may help",
        StatusCode.INVALID_MOTION_PLAN,
    )


def instants(law: SpeedLaw) -> FloatArray:
    """Instants (M,) s of a law at which a stroke is looked at."""
    count = int(np.clip(law.total / _STEP_S, _SAMPLES_MIN, _SAMPLES_MAX))
    share = np.linspace(0.0, 1.0, PER_RAMP)
    inner = (law.times[:-1, None] + share * law.duration[:, None]).ravel()
    return np.unique(np.concatenate([np.linspace(0.0, law.total, count), inner]))


def _stroke_within_limits(
    made: TimedStroke, tolerance: float, limits: MotionLimits, scene: PlanningScene
) -> TimedStroke:
    """The stroke with more time where a limit is exceeded, as far as the tolerance allows."""
    law = made.law
    most = np.inf if tolerance >= 1.0 else 1.0 / (1.0 - _SHOWN * tolerance)
    knots = np.linspace(0.0, law.total, int(np.clip(law.total / _WARP_S, _WARP_MIN, _WARP_MAX)))
    slowness = np.ones(len(knots))
    from scipy.ndimage import convolve1d, maximum_filter1d

    window = np.hanning(2 * _AROUND + 3)[1:-1]
    tau = np.unique(np.concatenate([instants(law), knots]))
    owner = np.clip(np.searchsorted(knots, tau), 0, len(knots) - 1)
    begun = made.at(tau)
    if use_of(begun, limits, scene).max() > most * 1.5:
        raise refused(begun, limits, scene, tolerance)
    for _ in range(_ROUNDS):
        slowed = replace(made, slowness=portable.interpolating_spline(knots, slowness, 5))
        use = use_of(slowed.at(tau), limits, scene)
        if use.max() <= ENOUGH:
            return slowed
        at_knots = np.ones(len(knots))
        np.maximum.at(at_knots, owner, use)
        widest = maximum_filter1d(np.maximum(at_knots * 1.002 - 1.0, 0.0), 2 * _AROUND + 1)
        slowness = slowness * (1.0 + convolve1d(widest, window / window.sum(), mode="nearest"))
        if slowness.max() > most:
            break
    raise refused(begun, limits, scene, tolerance)


def refused(
    motion: DrivenMotion, limits: MotionLimits, scene: PlanningScene, tolerance: float
) -> PathRefusedError:
    """Why the speed can't be kept: the worst place, its axis and what it lacks."""
    factor = use_of(motion, limits, scene)
    k = int(np.argmax(factor))
    speed = motion.speed[k]
    slowest = f"; there it could do about {speed / factor[k]:.3g} m/s" if speed > 0.0 else ""
    return PathRefusedError(
        f"{_worst(motion, k, limits, scene)} at {motion.s[k]:.3f} m, where the tool moves at "
        f"{speed:.3g} m/s"
        f"{singularity(motion.q[k], scene)}{slowest}; speed_tolerance is {tolerance:g}",
        StatusCode.INVALID_MOTION_PLAN,
    )


def _worst(motion: DrivenMotion, k: int, limits: MotionLimits, scene: PlanningScene) -> str:
    """The axis that lacks most at instant k of a motion, and what it lacks."""
    torque = torque_use(
        scene.dynamics, motion.q[k : k + 1], motion.qd[k : k + 1], motion.qdd[k : k + 1]
    )[0]
    shares = {
        "velocity": np.abs(motion.qd[k]) / limits.velocity,
        "acceleration": np.abs(motion.qdd[k]) / limits.acceleration,
        "jerk": np.abs(motion.qddd[k]) / limits.jerk,
        "torque": torque / limits.torque_share,
    }
    powers = {"velocity": 1.0, "acceleration": 0.5, "jerk": 1.0 / 3.0, "torque": 0.5}
    what = max(shares, key=lambda name: float(portable.power(shares[name].max(), powers[name])))
    j = int(np.argmax(shares[what]))
    return f"{scene.cell.robot.joint_names[j]} needs {shares[what][j]:.2f} times its {what} limit"


# A timed path as the trajectory that is sent: so many points that the tool keeps to the path
# between.

POINT_ERROR = 1e-5  # m by which the interpolant may leave the path between points
_POINT_TURN = 1e-4  # rad
_SPEED_ERROR = 5e-4  # share of the tool's speed
_JERK_USED = 0.995  # of the limit, at most
_SPACING = 0.06  # m between the first points
_LONGEST = 0.5  # s between them
_PER_RAMP = 4
_INSIDE = np.array([0.002, 0.12, 0.31, 0.5, 0.69, 0.88, 0.998])  # where an interval is looked at
_ROUNDS_POINTS = 10
_SHORTEST_NS = 400_000


class SentPath(NamedTuple):
    """The trajectory with its strokes, when each begins (K,) s, and the law's instants of its
    points (K of (P,) s).
    """

    trajectory: JointTrajectory
    strokes: tuple[TimedStroke, ...]
    begins: FloatArray
    instants: tuple[FloatArray, ...]


def sent(strokes: tuple[TimedStroke, ...], limits: MotionLimits, scene: PlanningScene) -> SentPath:
    """The strokes one after the other, at rest between them."""
    names = scene.cell.robot.joint_names
    times: list[IntArray] = []
    rows: list[tuple[FloatArray, ...]] = []
    begins = []
    instants = []
    begin_ns = 0
    for stroke in strokes:
        tau = _dense_enough(stroke, limits, scene)
        motion = stroke.at(tau)
        qd = motion.qd.copy()
        qdd = motion.qdd.copy()
        qd[[0, -1]] = 0.0
        qdd[[0, -1]] = 0.0
        first = 1 if times else 0
        begins.append(begin_ns / NS_PER_S)
        instants.append(tau)
        ns = begin_ns + np.rint(motion.t * NS_PER_S).astype(np.int64)
        times.append(ns[first:])
        rows.append((motion.q[first:], qd[first:], qdd[first:]))
        begin_ns = int(ns[-1])
    q, qd, qdd = (np.concatenate(column) for column in zip(*rows, strict=True))
    trajectory = JointTrajectory(names, np.concatenate(times), q, qd, qdd)
    return SentPath(trajectory, strokes, np.array(begins), tuple(instants))


def _dense_enough(stroke: TimedStroke, limits: MotionLimits, scene: PlanningScene) -> FloatArray:
    """Instants (P,) s of a stroke's law at which points are needed."""
    tau = _first_points(stroke)
    open_ = np.ones(len(tau) - 1, dtype=bool)
    for _ in range(_ROUNDS_POINTS):
        worst = np.zeros(len(open_))
        worst[open_] = _between(stroke, tau, np.flatnonzero(open_), limits, scene)
        open_ = (worst > 1.0) & (np.diff(tau) * NS_PER_S > 2 * _SHORTEST_NS)
        if not open_.any():
            break
        middle = 0.5 * (tau[:-1] + tau[1:])[open_]
        halves = np.repeat(open_, np.where(open_, 2, 1))
        tau = np.sort(np.concatenate([tau, middle]))
        open_ = halves
    return tau


def _first_points(stroke: TimedStroke) -> FloatArray:
    law = stroke.law
    rates = np.maximum(law.first, law.last)
    counts = np.ceil(np.maximum(law.duration * rates / _SPACING, law.duration / _LONGEST)).astype(
        int
    )
    counts = np.maximum(counts, np.where(law.first == law.last, 1, _PER_RAMP))
    inner = [
        np.linspace(begin, end, count + 1)[:-1]
        for begin, end, count in zip(law.times[:-1], law.times[1:], counts, strict=True)
    ]
    return np.append(np.concatenate(inner), law.total)


def _between(
    stroke: TimedStroke,
    tau: FloatArray,
    which: IntArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> FloatArray:
    """How far the interpolant leaves the stroke, or the jerk its limit, between points `which` (W,)
    and the next: 1 is allowed.
    """
    ends = stroke.at(tau)
    inside = tau[which, None] + _INSIDE * np.diff(tau)[which, None]
    asked = stroke.at(inside.ravel())
    trajectory = JointTrajectory(
        scene.cell.robot.joint_names,
        np.rint(ends.t * NS_PER_S).astype(np.int64),
        ends.q,
        ends.qd,
        ends.qdd,
    )
    motion = trajectory.sample(asked.t)
    off = motion.q - asked.q
    away = motion.qd - asked.qd
    jacobian = scene.chain.jacobian(asked.q)
    place, turn = (
        np.linalg.norm(np.einsum("mij,mj->mi", jacobian[:, rows], off), axis=1) for rows in _ROWS
    )
    speed = np.linalg.norm(np.einsum("mij,mj->mi", jacobian[:, :3], away), axis=1)
    top = max(float(asked.speed.max()), 1e-9)
    jerk = (np.abs(motion.qddd) / limits.jerk).max(axis=1) / _JERK_USED
    worst = np.maximum.reduce(
        [place / POINT_ERROR, turn / _POINT_TURN, speed / (_SPEED_ERROR * top), jerk]
    )
    return np.asarray(worst.reshape(len(which), -1).max(axis=1))


_ROWS = (slice(0, 3), slice(3, 6))
