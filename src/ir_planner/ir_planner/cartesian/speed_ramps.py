"""The speed of the tool: constant along each part, ramps within the axes' limits."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_planner.cartesian.joint_curve import JointCurve
from ir_planner.scene import MotionLimits, PlanningScene, lasting_longer, torque_use
from ir_values.arrays import BoolArray, FloatArray

# The tool's speed over time: constant along each part, and between two speeds a ramp without jumps
# of acceleration. A ramp lies in the faster part, so the tool is nowhere faster than asked for.


@dataclass(frozen=True)
class StrokeSpan:
    """A part of a stroke: length [m], the speed asked for [m/s], whether it has to be kept."""

    length: float
    speed: float
    kept: bool = True


class TooShortError(Exception):
    """Span `index` is too short for its ramps, by `missing` m."""

    def __init__(self, index: int, missing: float) -> None:
        super().__init__(f"span {index} lacks {missing:g} m")
        self.index = index
        self.missing = missing


@dataclass(frozen=True, eq=False)
class SpeedLaw:
    """Phases (P,): duration [s], speed at the beginning and the end [m/s]; even: constant speed
    that is to be kept.
    """

    duration: FloatArray
    first: FloatArray
    last: FloatArray
    even: BoolArray

    @cached_property
    def times(self) -> FloatArray:
        """When phases begin and end (P + 1,) s."""
        return np.concatenate([[0.0], np.cumsum(self.duration)])

    @cached_property
    def places(self) -> FloatArray:
        """Where phases begin and end (P + 1,) m."""
        return np.concatenate([[0.0], np.cumsum(0.5 * (self.first + self.last) * self.duration)])

    @property
    def total(self) -> float:
        """Seconds."""
        return float(self.times[-1])

    def phase(self, t: FloatArray) -> np.ndarray:
        """The phase (M,) at t (M,) s."""
        return np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.duration) - 1)

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """s [m], speed, acceleration and jerk (M,) at t (M,) s."""
        k = self.phase(t)
        T = self.duration[k]
        v = self.first[k]
        dv = (self.last - self.first)[k]
        x = np.clip((t - self.times[k]) / T, 0.0, 1.0)
        s = self.places[k] + T * x * (v + dv * x * x * (1.0 - 0.5 * x))
        speed = v + dv * x * x * (3.0 - 2.0 * x)
        return s, speed, dv / T * 6.0 * x * (1.0 - x), dv / (T * T) * (6.0 - 12.0 * x)


def law_of(spans: tuple[StrokeSpan, ...], ramps: FloatArray) -> SpeedLaw:
    """From rest to rest; ramps (K + 1,) s: how long the changes of speed take at the ends of the
    spans.

    The faster of two spans gives the place for the ramp between them. Raises TooShortError.
    """
    speeds = np.array([0.0, *(span.speed for span in spans), 0.0])
    covered = 0.5 * (speeds[1:] + speeds[:-1]) * ramps
    phases: list[tuple[float, float, float, bool]] = []
    for k, span in enumerate(spans):
        before = speeds[k]
        own = speeds[k + 1]
        after = speeds[k + 2]
        rises = before < own
        falls = after < own
        left = span.length - (covered[k] if rises else 0.0) - (covered[k + 1] if falls else 0.0)
        if left < 0.0:
            raise TooShortError(k, -left)
        if rises:
            phases.append((ramps[k], before, span.speed, False))
        phases.append((left / span.speed, span.speed, span.speed, span.kept))
        if falls:
            phases.append((ramps[k + 1], span.speed, after, False))
    lasting = [phase for phase in phases if phase[0] > 1e-9]
    durations, firsts, lasts, kept = zip(*lasting, strict=True)
    return SpeedLaw(np.array(durations), np.array(firsts), np.array(lasts), np.array(kept, bool))


def ramp_places(
    spans: tuple[StrokeSpan, ...], k: int, duration: FloatArray
) -> tuple[FloatArray, float, float]:
    """Where the ramp before span k (or after the last) begins (D,) m for durations (D,) s; both
    speeds.
    """
    speeds = [0.0, *(span.speed for span in spans), 0.0]
    ends = [0.0, *itertools.accumulate(span.length for span in spans)]
    first = speeds[k]
    last = speeds[k + 1]
    covered = 0.5 * (first + last) * duration
    return (ends[k] - covered if first > last else np.full_like(duration, ends[k])), first, last


# What the axes do where the tool moves along a curve of theirs, and how much of the limits that
# takes.


class DrivenMotion(NamedTuple):
    """Motion at M instants: t (M,) s, s (M,) m along the path, speed (M,) m/s; q, qd, qdd, qddd (M,
    n).
    """

    t: FloatArray
    s: FloatArray
    speed: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    qddd: FloatArray


def driven(
    curve: JointCurve, t: FloatArray, s: FloatArray, v: FloatArray, a: FloatArray, j: FloatArray
) -> DrivenMotion:
    """The axes at s (M,) with speed, acceleration and jerk (M,) along the path."""
    along = curve.at(np.clip(s, curve.begin, curve.end))
    return with_speed(along, t, s, v, a, j)


def with_speed(
    along: tuple[FloatArray, ...],
    t: FloatArray,
    s: FloatArray,
    v: FloatArray,
    a: FloatArray,
    j: FloatArray,
) -> DrivenMotion:
    """The motion at times t (M,) [s] by the chain rule: s (M,) [m] moves at speed v, acceleration a
    and jerk j (M,); along: q and its three derivatives by s, each (M, n).
    """
    q, first, second, third = along
    v1 = v[:, None]
    a1 = a[:, None]
    j1 = j[:, None]
    qd = first * v1
    qdd = second * (v1 * v1) + first * a1
    qddd = third * portable.power(v1, 3) + 3.0 * second * v1 * a1 + first * j1
    return DrivenMotion(t, s, v, q, qd, qdd, qddd)


def use_of(motion: DrivenMotion, limits: MotionLimits, scene: PlanningScene) -> FloatArray:
    """By what factor (M,) a motion would have to last longer; at most 1: within the limits."""
    torque = torque_use(scene.dynamics, motion.q, motion.qd, motion.qdd)
    return lasting_longer(
        limits, np.abs(motion.qd), np.abs(motion.qdd), np.abs(motion.qddd), torque
    )


# How long the tool takes from one speed to the next: as short as the limits of the axes allow.

USED = 0.97  # of a limit: the interpolant between points needs a little more than the samples
PER_RAMP = 13
ENOUGH = 1.0 + 1e-4
_RAMPS = portable.geomspace(0.01, 10.0, 13)  # s
_FINER = 8
_ZOOMS = 3


def ramps_of(
    curve: JointCurve,
    spans: tuple[StrokeSpan, ...],
    limits: MotionLimits,
    scene: PlanningScene,
    *,
    slow: bool,
    used: float = USED,
) -> FloatArray:
    """The shortest ramps (K + 1,) s between the speeds at all boundaries that need no more of the
    limits than the constant speed beside them does, or `used`. slow: where that is too much, one
    that keeps them, if there is one; a path that begins near a singularity is driven slowly there.
    """
    found = [_ramp(curve, spans, k, limits, scene, slow, used) for k in range(len(spans) + 1)]
    return np.array(found)


def _ramp(
    curve: JointCurve,
    spans: tuple[StrokeSpan, ...],
    k: int,
    limits: MotionLimits,
    scene: PlanningScene,
    slow: bool,
    used: float,
) -> float:
    """The ramp [s] at boundary k."""
    _, first, last = ramp_places(spans, k, _RAMPS[:1])
    if first == last:
        return 0.0

    def use(durations: FloatArray) -> tuple[FloatArray, FloatArray]:
        return _ramps_use(curve, spans, k, durations, limits, scene)

    def beside(ramp: FloatArray, cruise: FloatArray) -> BoolArray:
        return np.less_equal(ramp, np.maximum(used, cruise))

    found = _shortest(lambda durations: beside(*use(durations)))
    if slow and use(np.array([found]))[0][0] > ENOUGH:
        longer = _shortest(lambda durations: use(durations)[0] <= used)
        if use(np.array([longer]))[0][0] <= ENOUGH:
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


def _ramps_use(
    curve: JointCurve,
    spans: tuple[StrokeSpan, ...],
    k: int,
    durations: FloatArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> tuple[FloatArray, FloatArray]:
    """What ramps of these durations (R,) s at the begin of span k need of the limits (R,), and the
    constant speed there (R,). Speeds in m/s; the speed of a ramp is a cubic without acceleration at
    its ends.
    """
    begin, first, last = ramp_places(spans, k, durations)
    x = np.linspace(0.0, 1.0, PER_RAMP)
    T = durations[:, None]
    rise = last - first
    covered = T * x * (first + rise * (x * x) * (1.0 - 0.5 * x))
    s = curve.begin + begin[:, None] + covered
    v = np.broadcast_to(first + rise * (x * x) * (3.0 - 2.0 * x), s.shape)
    a = rise / T * 6.0 * x * (1.0 - x)
    j = rise / (T * T) * (6.0 - 12.0 * x)

    none = np.zeros(s.size)
    places = s.ravel()
    even = np.full(s.size, max(first, last))
    along = curve.at(np.clip(places, curve.begin, curve.end))
    in_ramp = with_speed(along, none, places, v.ravel(), a.ravel(), j.ravel())
    at_speed = with_speed(along, none, places, even, none, none)
    ramp = use_of(in_ramp, limits, scene)
    cruise = use_of(at_speed, limits, scene)
    return ramp.reshape(s.shape).max(axis=1), cruise.reshape(s.shape).max(axis=1)
