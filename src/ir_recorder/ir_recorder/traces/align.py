"""Traces of several clocks on one time axis: resampling, and the offset of a clock by
cross-correlation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import correlate

from ir_msgs_py.arrays import FloatArray
from ir_recorder.errors import TraceError

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
    TraceError where no offset stands out: the signals are too short, too flat, or not of the same
    run.
    """
    first = _regular(time, watts)
    second = _regular(other_time, other_watts)
    products = correlate(first - first.mean(), second - second.mean(), method="fft")
    lags = np.arange(len(products)) - (len(second) - 1)
    overlap = _norms(first - first.mean(), second - second.mean())
    score = np.where(
        np.abs(lags / RATE + time[0] - other_time[0]) <= longest, products / overlap, -np.inf
    )
    peak = int(np.argmax(score))
    best = float(score[peak])
    if not best >= LEAST_CORRELATION:
        raise TraceError(
            f"the clocks' offset can't be found: the powers agree by {best:.2f} at best, at least "
            f"{LEAST_CORRELATION} is needed; give clock_offset"
        )
    shift = (lags[peak] + _parabola(score, peak)) / RATE
    return ClockOffset(float(time[0] - other_time[0] + shift), best)


def _regular(time: FloatArray, values: FloatArray) -> FloatArray:
    span = float(time[-1] - time[0])
    count = int(span * RATE) + 1
    if not 3 <= count <= MOST_SAMPLES:
        raise TraceError(f"the clocks' offset can't be found in {span:g} s of data")
    return np.asarray(np.interp(time[0] + np.arange(count) / RATE, time, values))


def _norms(first: FloatArray, second: FloatArray) -> FloatArray:
    """What each product of the correlation is divided by: norms of the parts that overlap, floored.

    The floor, a fifth of the smaller signal's norm, keeps short overlaps from agreeing by chance.
    """
    ones_first = np.ones(len(first))
    ones_second = np.ones(len(second))
    own = correlate(first**2, ones_second, method="fft").clip(0.0)
    other = correlate(ones_first, second**2, method="fft").clip(0.0)
    floor = 0.2 * min(float(first @ first), float(second @ second)) + 1e-12
    return np.asarray(np.sqrt(np.maximum(own, floor) * np.maximum(other, floor)))


def _parabola(score: FloatArray, peak: int) -> float:
    """How far beside the sample the peak is, in samples."""
    if not 0 < peak < len(score) - 1 or not np.isfinite(score[[peak - 1, peak + 1]]).all():
        return 0.0
    before, at, after = score[peak - 1 : peak + 2]
    bend = before - 2.0 * at + after
    return float(0.5 * (before - after) / bend) if bend < 0.0 else 0.0
