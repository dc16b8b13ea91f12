"""Measured data on one clock: columns over increasing seconds, resampling, and clock offsets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from ir_recorder.errors import RecorderError
from ir_values.arrays import FloatArray

# Measured data on one clock: columns of numbers and of words over strictly increasing seconds, in
# SI.

TIME = "time"
POWER = "power"  # W at the mains
ENERGY = "energy"  # J at the mains
MODE = "mode"  # name of a power mode
LOAD = "load"  # what is attached: "gripper+part", "none"
VELOCITY = "_velocity"
ACCELERATION = "_acceleration"
EFFORT = "_effort"  # Nm of the motor, at the joint
CURRENT = "_current"  # A of the motor
ENDINGS = ("", VELOCITY, ACCELERATION, EFFORT, CURRENT)  # of a joint's columns
GAP_FACTOR = 4.0  # a step so many times longer than the usual one is a gap


@dataclass(frozen=True, eq=False)
class Trace:
    """N instants of one source: time (N,) s; columns by name, each (N,), NaN where a value is
    missing; texts by name, each of N words; problems that did not prevent reading.

    sampled: `power` holds values of the instants; else means since the row before, as meters report
    them.
    """

    source: str
    time: FloatArray
    columns: Mapping[str, FloatArray]
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: MappingProxyType({}))
    problems: tuple[str, ...] = ()
    sampled: bool = False

    def __post_init__(self) -> None:
        if len(self.time) < 2:
            raise RecorderError(
                f"{self.source}: has {len(self.time)} points, a trace has at least 2"
            )
        back = np.flatnonzero(np.diff(self.time) <= 0.0)
        if len(back):
            k = int(back[0])
            raise RecorderError(
                f"{self.source}: time {self.time[k + 1]:g} s follows {self.time[k]:g} s"
            )
        self.time.setflags(write=False)
        for values in self.columns.values():
            values.setflags(write=False)

    @property
    def period(self) -> float:
        """The usual step [s]: the median."""
        return float(np.median(np.diff(self.time)))

    def joints(self, names: Sequence[str], ending: str = "") -> FloatArray | None:
        """Columns (N, n) of all joints with an ending ("", "_velocity", ...); None where none has
        it.

        RecorderError where some have it and others have not.
        """
        wanted = [f"{name}{ending}" for name in names]
        missing = [name for name in wanted if name not in self.columns]
        if len(missing) == len(wanted):
            return None
        if missing:
            known = ", ".join(self.columns)[:200]
            raise RecorderError(
                f"{self.source}: there is no column {missing[0]}, there is: {known}"
            )
        return np.column_stack([self.columns[name] for name in wanted])

    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Where rows are missing: (time [s], length [s]) of steps much longer than the usual
        one.
        """
        steps = np.diff(self.time)
        return tuple(
            (float(self.time[k]), float(steps[k]))
            for k in np.flatnonzero(steps > GAP_FACTOR * self.period)
        )

    def shifted(self, offset: float) -> Trace:
        """The trace on another clock: `offset` [s] is added to the time."""
        return Trace(
            self.source, self.time + offset, self.columns, self.texts, self.problems, self.sampled
        )

    def joules(self) -> FloatArray | None:
        """Energy at the mains (N,) J since the first row, by the meter's count or its power; None
        without.

        A reading of power that is missing counts as the one before.
        """
        if ENERGY in self.columns:
            count = _filled(self.columns[ENERGY])
            return np.asarray(count - count[0])
        if POWER not in self.columns:
            return None
        watts = _filled(self.columns[POWER])
        steps = np.diff(self.time)
        mean = 0.5 * (watts[1:] + watts[:-1]) if self.sampled else watts[1:]
        return np.concatenate([[0.0], np.cumsum(mean * steps)])


def _filled(values: FloatArray) -> FloatArray:
    """Missing values replaced by the one before; by the first one at the start."""
    known = np.isfinite(values)
    if not known.any():
        raise RecorderError("a column of the meter holds no value at all")
    rows = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return np.where(rows < 0, values[np.argmax(known)], values[np.maximum(rows, 0)])


# Traces of several clocks on one time axis: resampling, and the offset of a clock by
# cross-correlation.

LEAST_CORRELATION = 0.6  # below it another offset fits nearly as well
RATE = 100.0  # Hz at which two signals are compared
MOST_SAMPLES = 2_000_000  # of a comparison: five hours


@dataclass(frozen=True)
class ClockOffset:
    """Seconds to add to the second clock, and how well the signals then agree (1: exactly)."""

    seconds: float
    correlation: float


def mean_power(time: FloatArray, joules: FloatArray, edges: FloatArray) -> FloatArray:
    """Mean watts (M,) between edges (M + 1,) s of an energy count (N,) J at `time` (N,) s; NaN
    outside.
    """
    count = np.interp(edges, time, joules, left=np.nan, right=np.nan)
    return np.asarray(np.diff(count) / np.diff(edges))


def resampled(
    time: FloatArray, values: FloatArray, at: FloatArray, longest_gap: float
) -> FloatArray:
    """Values (N, ...) linear at the instants `at` (M,); NaN outside, and inside gaps longer than
    that [s].
    """
    columns = values.reshape(len(time), -1)
    found = np.column_stack([_linear(time, column, at, longest_gap) for column in columns.T])
    return np.asarray(found.reshape(len(at), *values.shape[1:]))


def _linear(time: FloatArray, values: FloatArray, at: FloatArray, longest_gap: float) -> FloatArray:
    known = np.isfinite(values)
    if np.count_nonzero(known) < 2:
        return np.full(len(at), np.nan)
    time = time[known]
    values = values[known]
    found = np.interp(at, time, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    exact = time[after] == at
    found[(time[after] - time[after - 1] > longest_gap) & ~exact & (time[after - 1] != at)] = np.nan
    return found


def clock_offset(
    time: FloatArray,
    watts: FloatArray,
    other_time: FloatArray,
    other_watts: FloatArray,
    longest: float = 3600.0,
) -> ClockOffset:
    """What to add to `other_time` so that two powers agree best; at most `longest` [s] is looked
    for.

    watts (N,) at time (N,) s, other_watts (M,) at other_time (M,) s.

    By the normalised cross-correlation of both at 100 Hz, between samples by a parabola through its
    peak.
    RecorderError where no offset stands out: the signals are too short, too flat, or not of the
    same run.
    """
    first = _regular(time, watts)
    second = _regular(other_time, other_watts)
    products = _correlated(first - first.mean(), second - second.mean())
    lags = np.arange(len(products)) - (len(second) - 1)
    overlap = _norms(first - first.mean(), second - second.mean())
    score = np.where(
        np.abs(lags / RATE + time[0] - other_time[0]) <= longest, products / overlap, -np.inf
    )
    peak = int(np.argmax(score))
    best = float(score[peak])
    if not best >= LEAST_CORRELATION:
        raise RecorderError(
            f"the clocks' offset can't be found: the powers agree by {best:.2f} at best, at least "
            f"{LEAST_CORRELATION} is needed; give clock_offset"
        )
    shift = (lags[peak] + _parabola(score, peak)) / RATE
    return ClockOffset(float(time[0] - other_time[0] + shift), best)


def _regular(time: FloatArray, values: FloatArray) -> FloatArray:
    span = float(time[-1] - time[0])
    count = int(span * RATE) + 1
    if not 3 <= count <= MOST_SAMPLES:
        raise RecorderError(f"the clocks' offset can't be found in {span:g} s of data")
    return np.asarray(np.interp(time[0] + np.arange(count) / RATE, time, values))


def _norms(first: FloatArray, second: FloatArray) -> FloatArray:
    """What each product of the correlation is divided by: norms of the parts that overlap, floored.

    The floor, a fifth of the smaller signal's norm, keeps short overlaps from agreeing by chance.
    """
    ones_first = np.ones(len(first))
    ones_second = np.ones(len(second))
    own = _correlated(first**2, ones_second).clip(0.0)
    other = _correlated(ones_first, second**2).clip(0.0)
    floor = 0.2 * min(float(first @ first), float(second @ second)) + 1e-12
    return np.asarray(np.sqrt(np.maximum(own, floor) * np.maximum(other, floor)))


def _correlated(first: FloatArray, second: FloatArray) -> FloatArray:
    """Sums of products (N + M - 1,) at every lag from -(M - 1), by Fourier transforms."""
    count = len(first) + len(second) - 1
    size = 1 << (count - 1).bit_length()
    product = np.fft.rfft(first, size) * np.fft.rfft(second[::-1], size)
    return np.fft.irfft(product, size)[:count]


def _parabola(score: FloatArray, peak: int) -> float:
    """How far beside the sample the peak is, in samples."""
    if not 0 < peak < len(score) - 1 or not np.isfinite(score[[peak - 1, peak + 1]]).all():
        return 0.0
    before, at, after = score[peak - 1 : peak + 2]
    bend = before - 2.0 * at + after
    return float(0.5 * (before - after) / bend) if bend < 0.0 else 0.0
