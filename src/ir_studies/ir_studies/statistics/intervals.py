"""What a sample of independent pairs says: intervals of mean and median, chance, and where they are too few.

A pair's differences are far from normal: most are near zero, a few large. The interval of the mean by
Student's t then holds less often than it says; that of the median by order statistics holds whatever the
distribution. A skewness too large for the count is found after Cochran, Sampling Techniques (1977), 2.15.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.special import stdtr
from scipy.stats import binom

from ir_msgs_py.arrays import FloatArray
from ir_recorder.analysis.agreement import LEVEL, Mean

_COCHRAN = 25.0  # pairs per squared skewness from which the interval of a mean is near its level


def median_of(values: FloatArray) -> Mean:
    """The median of independent values (N,) with its interval by order statistics: at least LEVEL for every
    distribution; NaN where N < 5 are too few.
    """
    count = len(values)
    if not count:
        return Mean(math.nan, math.nan, math.nan)
    ordered, k = np.sort(values), _rank(count)
    low, high = (math.nan, math.nan) if k < 0 else (float(ordered[k]), float(ordered[count - 1 - k]))
    return Mean(float(np.median(ordered)), low, high)


@cache
def _rank(count: int) -> int:
    """The largest k for which as many as k of `count` values lie below the median in at most half of
    1 - LEVEL; -1 where there is none.
    """
    return int(np.searchsorted(binom.cdf(np.arange(count), count, 0.5), 0.5 * (1.0 - LEVEL), "right")) - 1


def chance_of(values: FloatArray) -> float:
    """How likely a mean as far from zero is by chance alone, by Student's t; NaN where values (N,) don't vary
    or are fewer than two.
    """
    if len(values) < 2 or np.ptp(values) == 0.0:
        return math.nan
    away = abs(float(values.mean())) * math.sqrt(len(values)) / float(values.std(ddof=1))
    return float(2.0 * stdtr(len(values) - 1, -away))


def skewed(values: FloatArray) -> bool:
    """Whether few of the values (N,) carry their mean, so that its interval holds less often than it says."""
    if len(values) < 3 or np.ptp(values) == 0.0:
        return False
    off = values - values.mean()
    skewness = float((off**3).mean()) / float((off**2).mean()) ** 1.5
    return bool(len(values) < _COCHRAN * skewness**2)


def shown_together(chances: Sequence[float]) -> list[bool]:
    """Which of several differences are shown, by Holm's rule: that any is shown by chance alone is at most as
    likely as 1 - LEVEL, however they depend on each other. Those without a chance (NaN) don't count.
    """
    tested = sorted((chance, k) for k, chance in enumerate(chances) if not math.isnan(chance))
    shown = [False] * len(chances)
    for done, (chance, k) in enumerate(tested):
        if chance * (len(tested) - done) > 1.0 - LEVEL:
            break
        shown[k] = True
    return shown
