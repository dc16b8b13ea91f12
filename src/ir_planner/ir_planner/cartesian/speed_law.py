"""The tool's speed over time: constant along each part, and between two speeds a ramp without jumps
of acceleration. A ramp lies in the faster part, so the tool is nowhere faster than asked for.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ir_msgs_py.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class Span:
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


def law_of(spans: tuple[Span, ...], ramps: FloatArray) -> SpeedLaw:
    """From rest to rest; ramps (K + 1,) s: how long the changes of speed take at the ends of the
    spans.

    Raises TooShortError.
    """
    speeds = np.array([0.0, *(span.speed for span in spans), 0.0])
    covered = 0.5 * (speeds[1:] + speeds[:-1]) * ramps
    phases: list[tuple[float, float, float, bool]] = []
    for k, span in enumerate(spans):
        rise = speeds[k] < speeds[k + 1]
        fall = speeds[k + 2] < speeds[k + 1]
        left = span.length - (covered[k] if rise else 0.0) - (covered[k + 1] if fall else 0.0)
        if left < 0.0:
            raise TooShortError(k, -left)
        if rise:
            phases.append((ramps[k], speeds[k], span.speed, False))
        phases.append((left / span.speed, span.speed, span.speed, span.kept))
        if fall:
            phases.append((ramps[k + 1], span.speed, speeds[k + 2], False))
    kept = [phase for phase in phases if phase[0] > 1e-9]
    duration, first, last, even = (np.array(column) for column in zip(*kept, strict=True))
    return SpeedLaw(duration, first, last, even.astype(bool))


def ramp_places(
    spans: tuple[Span, ...], k: int, duration: FloatArray
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
