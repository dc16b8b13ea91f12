"""Intervals for the claims of the paper: bootstrap over what was drawn independently, 95 %."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence

import numpy as np
from scipy.stats import rankdata

from ir_msgs_py.arrays import FloatArray, IntArray

RESAMPLES = 1000
LEVEL = 95.0  # %
_SEED = 7  # of the resampling, so that the same rows give the same interval
Statistic = Callable[..., float]


def interval(
    statistic: Statistic,
    *columns: Sequence[float] | FloatArray,
    groups: Sequence[Hashable] | None = None,
) -> tuple[float, float, float]:
    """The statistic of columns (N,) with its 95 % interval: value, low, high.

    groups: what each row belongs to; groups are drawn as a whole, for rows of one task are no
    independent sample. Nan where there is nothing to draw from.
    """
    data = [np.asarray(column, dtype=float) for column in columns]
    if len(data[0]) == 0:
        return math.nan, math.nan, math.nan
    members = _members(groups) if groups is not None else None
    count = len(members) if members is not None else len(data[0])
    value = float(statistic(*data))
    rng = np.random.default_rng(_SEED)
    if count < 2:
        return value, math.nan, math.nan
    drawn = np.empty(RESAMPLES)
    for k in range(RESAMPLES):
        rows = rng.integers(0, count, count)
        if members is not None:
            rows = np.concatenate([members[j] for j in rows])
        drawn[k] = statistic(*(column[rows] for column in data))
    tail = (100.0 - LEVEL) / 2.0
    low, high = np.nanpercentile(drawn, [tail, 100.0 - tail])
    return value, float(low), float(high)


def _members(groups: Sequence[Hashable]) -> list[IntArray]:
    rows: dict[Hashable, list[int]] = {}
    for k, group in enumerate(groups):
        rows.setdefault(group, []).append(k)
    return [np.array(some) for some in rows.values()]


def mean(x: FloatArray) -> float:
    """Arithmetic mean."""
    return float(np.mean(x))


def median(x: FloatArray) -> float:
    """Median."""
    return float(np.median(x))


def geometric_mean(x: FloatArray) -> float:
    """Geometric mean, of ratios."""
    return float(np.exp(np.mean(np.log(x))))


def rank_correlation(x: FloatArray, y: FloatArray) -> float:
    """Spearman's, nan where one of both is constant."""
    a = rankdata(x)
    b = rankdata(y)
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return math.nan
    return float(np.corrcoef(a, b)[0, 1])


def variation(x: FloatArray) -> float:
    """Coefficient of variation: standard deviation over mean."""
    return float(np.std(x, ddof=1) / np.mean(x)) if len(x) > 1 and np.mean(x) > 0.0 else math.nan


def share(
    successes: Sequence[float], groups: Sequence[Hashable] | None = None
) -> tuple[float, float, float]:
    """The mean of successes or chances (N,) in [0, 1] with its interval; where all are equal
    nothing can be resampled, and the interval is Wilson's for so many groups.
    """
    found = interval(mean, successes, groups=groups)
    if found[1] < found[2] or not len(successes):
        return found
    count = len(set(groups)) if groups is not None else len(successes)
    return wilson(round(found[0] * count), count)


def mean_difference(
    points: Sequence[float], groups: Sequence[Hashable] | None = None
) -> tuple[float, float, float]:
    """The mean of differences (N,) of two successes [percentage points] with its interval. Where
    all are
    equal nothing can be resampled: as many groups without another difference leave a share of such
    by Wilson possible, to either side.
    """
    found = interval(mean, points, groups=groups)
    if not len(points) or found[1] < found[2]:
        return found
    count = len(set(groups)) if groups is not None else len(points)
    other = 100.0 * wilson(0, count)[2]
    return found[0], max(found[0] - other, -100.0), min(found[0] + other, 100.0)


def percent(found: tuple[float, float, float]) -> tuple[float, float, float]:
    """The same in percent."""
    return 100.0 * found[0], 100.0 * found[1], 100.0 * found[2]


def wilson(successes: int, count: int) -> tuple[float, float, float]:
    """A share with its 95 % interval after Wilson, which is right near 0 and 1 too."""
    if count == 0:
        return math.nan, math.nan, math.nan
    z = 1.96
    share = successes / count
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = (
        z
        * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
        / (1 + z * z / count)
    )
    return share, middle - half, middle + half
