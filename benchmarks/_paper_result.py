"""Answers of an experiment on a claim of the paper: statements with intervals, and a verdict for
each.

A statement names a figure and the bound from which on the paper is right. It holds where the whole
95 % interval keeps the bound, it does not where none of it does, else it can't be decided. An
experiment runs with
several seeds, which share nothing: where one of them alone says otherwise, it can't be decided
either. What can't be decided says how much larger a sample would decide it, if its figure stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import rankdata

from ir_values.arrays import FloatArray, IntArray

Row = dict[str, Any]

HOLDS = "holds"
FAILS = "does not hold"
OPEN = "cannot be decided"
MEASURED = "measured"
CALIBRATED = "calibration"
JUDGED = (HOLDS, FAILS, OPEN)
MOST_TIMES = 50  # a sample so many times as large is not made


@dataclass(frozen=True)
class Statement:
    """says: what would follow from the paper; figure: what was measured, `value` with its interval
    from `low` to `high`, from `count` of `what`. It holds from `bound` on, or up to it (`at_least`
    False); a nan bound: nothing is claimed.
    """

    says: str
    figure: str
    value: float
    low: float
    high: float
    count: int
    what: str
    unit: str = ""
    bound: float = math.nan
    at_least: bool = True
    verdict: str = ""
    note: str = ""

    @property
    def alone(self) -> str:
        """The verdict of this figure with its interval."""
        if self.verdict:
            return self.verdict
        if math.isnan(self.bound):
            return MEASURED
        if not all(map(math.isfinite, (self.low, self.high))):
            return OPEN
        kept = (self.low >= self.bound, self.high >= self.bound)
        if not self.at_least:
            kept = (self.high <= self.bound, self.low <= self.bound)
        return HOLDS if kept[0] else OPEN if kept[1] else FAILS

    def short_by(self, seeds: int) -> float:
        """How many times the sample each of so many seeds would need alone for an interval that
        ends at the
        bound: it narrows with the root of the sample, Wilson's of shares that never varied, z^2 /
        (N + z^2), with the sample. Inf where the figure is the bound, nan without a width.
        """
        gap = abs(self.value - self.bound)
        width = self.value - self.low if self.value > self.bound else self.high - self.value
        share = self.unit == "%" and self.value in (0.0, 100.0)
        difference = self.unit == "points" and self.value == 0.0 and self.low == -self.high
        if (share or difference) and min(gap, width) > 0.0:
            return seeds * (100.0 / gap - 1.0) / (100.0 / width - 1.0)
        return seeds * (width / gap) ** 2 if gap > 0.0 else math.inf


@dataclass(frozen=True)
class Experiment:
    """One claim: `paper` is its statement in our words, `asked` what is done about it.
    measure(seed, quick) answers rows; judge(rows) statements; follows(statements) what that means;
    tables(rows) further tables by their titles; draw(rows, file) a picture, which `caption`
    explains.
    """

    name: str
    title: str
    paper: str
    asked: str
    measure: Callable[[int, bool], list[Row]]
    judge: Callable[[Sequence[Row]], list[Statement]]
    follows: Callable[[Sequence[Statement]], str]
    tables: Callable[[Sequence[Row]], dict[str, list[Row]]] = lambda rows: {}
    draw: Callable[[Sequence[Row], Path], None] | None = None
    caption: str = ""
    seeded: bool = True  # whether anything in it is drawn at random


def judged(experiment: Experiment, rows: Sequence[Row]) -> list[Statement]:
    """The statements over all rows, each with its verdict; one that a seed alone contradicts is
    open.
    """
    whole = experiment.judge(rows)
    seeds = sorted({row["seed"] for row in rows})
    several = seeds if len(seeds) > 1 else []
    apart = [experiment.judge([row for row in rows if row["seed"] == seed]) for seed in several]
    found = []
    for k, statement in enumerate(whole):
        others = [by_seed[k].alone for by_seed in apart]
        verdict = statement.alone
        note = statement.note
        if verdict in (HOLDS, FAILS) and any(other != verdict for other in others):
            note = f"over all seeds it {verdict}; seed by seed: {', '.join(others)}"
            verdict = OPEN
        if verdict == OPEN:
            note = "; ".join(filter(None, (note, _larger(statement.short_by(len(seeds))))))
        found.append(replace(statement, verdict=verdict, note=note))
    return found


def _larger(times: float) -> str:
    """The size of a sample that would decide, as words."""
    if math.isnan(times):
        return ""
    if times > MOST_TIMES:
        return f"too near its bound for {MOST_TIMES} times the sample"
    return f"about {max(math.ceil(times), 2)} times the sample would"


# Intervals for the claims of the paper: bootstrap over what was drawn independently, 95 %.

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


# Pictures of the claims of the paper: small PNG files in one style.

mpl.use("Agg")


DPI = 100


def panels(
    count: int, *, width: float = 4.6, height: float = 4.0
) -> tuple[Figure, tuple[Axes, ...]]:
    """A figure with so many panels side by side, `width` x `height` inch each."""
    figure, axes = plt.subplots(1, count, figsize=(width * count, height), squeeze=False)
    for panel in axes[0]:
        panel.grid(alpha=0.3)
    return figure, tuple(axes[0])


def finished(figure: Figure, file: Path) -> None:
    """Write the figure."""
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=DPI)
    plt.close(figure)


def bars(axes: Axes, values: dict[str, tuple[float, float, float]], **style: Any) -> None:
    """Horizontal bars with their intervals: value, low, high by label."""
    labels = list(values)
    middle = [values[name][0] for name in labels]
    lower = [max(values[name][0] - values[name][1], 0.0) for name in labels]
    upper = [max(values[name][2] - values[name][0], 0.0) for name in labels]
    axes.barh(range(len(labels)), middle, xerr=[lower, upper], capsize=3, **style)
    axes.set_yticks(range(len(labels)), labels)
    axes.invert_yaxis()
