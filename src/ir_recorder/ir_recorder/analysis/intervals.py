"""Intervals of a sample of independent values: mean and median, chance, and where they are too few.

Differences of pairs are far from normal: most are near zero, a few large. Student's t then leaves
out a mean that few carry, Hall's transformation of t by the sample's skewness (J. R. Statist. Soc.
B 54 (1992), 221) holds less often than t where the tails are heavy and even. The interval of a mean
is the union of both, its chance the larger of both. That of the median is by order statistics and
holds whatever the distribution. A skewness too large for the count is found after Cochran, Sampling
Techniques (1977), 2.15.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from ir_values.arrays import FloatArray

LEVEL = 0.90  # of all intervals
ALIKE = 1e-7  # of shares and of values in percent: below, two figures differ by rounding
_COCHRAN = 25.0  # values per squared skewness from which the interval of a mean is near its level


@dataclass(frozen=True)
class Mean:
    """A mean or a median with its interval of LEVEL; NaN where there is none."""

    value: float
    low: float
    high: float


def alike(values: FloatArray) -> bool:
    """Whether values (N,) differ by rounding at most, as fewer than two do."""
    return len(values) < 2 or float(np.ptp(values)) <= ALIKE * max(1.0, float(np.abs(values).max()))


def mean_of(values: FloatArray) -> Mean:
    """The mean of independent values (N,) with its interval of LEVEL: zero lies outside where their
    chance is less than 1 - LEVEL. NaN where they are alike.
    """
    mean = float(values.mean()) if len(values) else math.nan
    if alike(values):
        return Mean(mean, math.nan, math.nan)
    from scipy.special import stdtrit  # a tenth of a second of imports, for who asks

    error = _error(values)
    k = _skewness(values) / math.sqrt(len(values))
    t = float(stdtrit(len(values) - 1, 0.5 + 0.5 * LEVEL))
    return Mean(
        mean, mean - error * max(t, _student(t, k)), mean - error * min(-t, _student(-t, k))
    )


def median_of(values: FloatArray) -> Mean:
    """The median of independent values (N,) with its interval by order statistics: at least LEVEL
    for every distribution; NaN where N < 5 are too few.
    """
    count = len(values)
    if not count:
        return Mean(math.nan, math.nan, math.nan)
    ordered = np.sort(values)
    k = _rank(count)
    low, high = (
        (math.nan, math.nan) if k < 0 else (float(ordered[k]), float(ordered[count - 1 - k]))
    )
    return Mean(float(np.median(ordered)), low, high)


@cache
def _rank(count: int) -> int:
    """The largest k for which as many as k of `count` values lie below the median in at most half
    of 1 - LEVEL; -1 where there is none.
    """
    from scipy.special import bdtr

    return (
        int(np.searchsorted(bdtr(np.arange(count), count, 0.5), 0.5 * (1.0 - LEVEL), "right")) - 1
    )


def chance_of(values: FloatArray) -> float:
    """How likely a mean as far from zero is by chance alone; NaN where values (N,) are alike."""
    if alike(values):
        return math.nan
    from scipy.special import stdtr

    away = float(values.mean()) / _error(values)
    k = _skewness(values) / math.sqrt(len(values))
    least = max(0.0, min(abs(away), math.copysign(1.0, away) * _hall(away, k)))
    return float(2.0 * stdtr(len(values) - 1, -least))


def skewed(values: FloatArray) -> bool:
    """Whether few of the values (N,) carry their mean, so that its interval may hold less often."""
    return not alike(values) and len(values) < _COCHRAN * _skewness(values) ** 2


def spread_of(values: FloatArray) -> float:
    """The standard deviation of the values (N,); NaN where there are fewer than two."""
    return float(values.std(ddof=1)) if len(values) > 1 else math.nan


def _error(values: FloatArray) -> float:
    return spread_of(values) / math.sqrt(len(values))


def _skewness(values: FloatArray) -> float:
    """Of values (N,) that are not alike, corrected for their number (Fisher and Pearson)."""
    off = values - values.mean()
    count = len(values)
    if count < 3:
        return 0.0
    skewness = float((off**3).mean() / (off**2).mean() ** 1.5)
    return skewness * math.sqrt(count * (count - 1)) / (count - 2)


def _hall(t: float, k: float) -> float:
    """Hall's monotone cubic of Student's t; k: skewness over the root of the count."""
    return t + k * (2.0 * t * t + 1.0) / 6.0 + k * k * t**3 / 27.0


def _student(h: float, k: float) -> float:
    """The t of which Hall's cubic is h: 3 (c - 1) / k, with c^3 - 1 divided by c - 1 so that k may
    be 0.
    """
    c = math.cbrt(1.0 + k * h - k * k / 6.0)
    return 3.0 * (h - k / 6.0) / (c * c + c + 1.0)


def shown_together(chances: Sequence[float]) -> list[bool]:
    """Which of several differences are shown, by Holm's rule: that any is shown by chance alone is
    at most as likely as 1 - LEVEL, however they depend on each other. Those without a chance (NaN)
    don't count.
    """
    tested = sorted((chance, k) for k, chance in enumerate(chances) if not math.isnan(chance))
    shown = [False] * len(chances)
    for done, (chance, k) in enumerate(tested):
        if chance * (len(tested) - done) > 1.0 - LEVEL:
            break
        shown[k] = True
    return shown
