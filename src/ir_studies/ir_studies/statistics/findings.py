"""Findings of the statistics: paired comparisons with intervals and effect sizes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_recorder.analysis.intervals import (
    ALIKE,
    Mean,
    alike,
    chance_of,
    mean_of,
    median_of,
    shown_together,
    skewed,
    spread_of,
)
from ir_studies.work import Row
from ir_values.arrays import FloatArray

SYNCHRONOUS = "synchronous"
ASYNCHRONOUS = "asynchronous"


def solved(row: Row, timing: str) -> bool:
    """Whether a certified movement was found with this timing."""
    return bool(row.get(timing, {}).get("solved", False))


def distinct(row: Row) -> list[str]:
    """Timings of a row with a movement of their own: the asynchronous answer may be the synchronous
    one.
    """
    found = [timing for timing in (SYNCHRONOUS, ASYNCHRONOUS) if solved(row, timing)]
    alike = len(found) == 2 and row[ASYNCHRONOUS].get("timing") != ASYNCHRONOUS
    return found[:1] if alike else found


def number(one: Row, name: str) -> float:
    """A figure of a movement, NaN where there is none."""
    value = one.get(name, math.nan)
    return float(value) if isinstance(value, int | float) else math.nan


# Reasons why pairs have no movement and movements no measurement, each with an example.

NO_PAIR = "pairs without both movements"
NOT_DRIVEN = "movements without a measurement"
# what differs where the reason is one
_FIGURES = re.compile(r"[-+]?\d[\d.,]*(?:e[-+]?\d+)?\b|\([^()]*\)")


@dataclass(frozen=True)
class PairFailure:
    """what: NO_PAIR or NOT_DRIVEN; how many for the same reason, and one of them in words."""

    what: str
    count: int
    example: str


def failures_of(rows: Sequence[Row]) -> tuple[PairFailure, ...]:
    """All reasons, the most frequent first."""
    found: dict[tuple[str, str], list[str]] = {}
    for what, words in [*_unsolved(rows), *_not_driven(rows)]:
        found.setdefault((what, _FIGURES.sub("", words)), []).append(words)
    kept = [PairFailure(what, len(each), each[0]) for (what, _), each in found.items()]
    return tuple(sorted(kept, key=lambda each: -each.count))


def _unsolved(rows: Sequence[Row]) -> Iterator[tuple[str, str]]:
    for row in rows:
        missing = [timing for timing in (SYNCHRONOUS, ASYNCHRONOUS) if not solved(row, timing)]
        if missing:
            one = row.get(missing[0], row)
            only = f"{missing[0]} joints alone have none: " if len(missing) == 1 else ""
            yield NO_PAIR, only + str(one.get("message", "") or "no answer")


def _not_driven(rows: Sequence[Row]) -> Iterator[tuple[str, str]]:
    for row in rows:
        for timing in distinct(row):
            if not math.isfinite(number(row[timing], "direct_j")):
                yield NOT_DRIVEN, str(row[timing].get("message", "") or "no reading of the meter")


PREDICTED = "energy, predicted"
DIRECT = "energy, direct"
PREDICTED_TO_DIRECT = "predicted against direct"
AGREEMENTS = (
    (PREDICTED_TO_DIRECT, "predicted_j"),
    ("indirect against direct", "indirect_j"),
)
"""Energies that are held against the directly measured one: name and column."""
NATURAL = (
    ("duration", "duration_s", "s"),
    (PREDICTED, "predicted_j", "J"),
    (DIRECT, "direct_j", "J"),
    ("energy, indirect", "indirect_j", "J"),
    ("peak power", "peak_w", "W"),
    ("path of the tcp", "path_m", "m"),
    ("movement cost", "movement_cost", ""),
    ("largest torque share", "torque_share", ""),
)
"""Natural values of section VI: what can be read off a movement, the column that holds it, and its
unit.
"""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Differences in percent: values of each pair, or of each movement where pairs have several;
    what follows is taken over `pairs`, which are independent: mean, the difference of all firsts
    together in percent of all seconds (ratio of sums), with its 90 % interval by linearisation; the
    median of the pairs' values with that by order statistics, effect (mean over standard deviation:
    Cohen's d of paired samples), chance of such a mean. spread: standard deviation of the values.
    skewed: few carry the mean.
    levels: means of the first and of the second, in `unit`; their ratio is the mean's.
    shown: a difference is shown, all comparisons of the table taken together.
    """

    name: str
    values: FloatArray
    pairs: int
    mean: Mean
    median: Mean
    spread: float
    effect: float
    chance: float
    skewed: bool
    levels: tuple[float, float]
    unit: str = ""
    shown: bool = False

    @property
    def count(self) -> int:
        """Values."""
        return len(self.values)

    @property
    def less(self) -> int:
        """Values in which the first is smaller."""
        return int((self.values < 0.0).sum())

    @property
    def more(self) -> int:
        """Values in which it is larger."""
        return int((self.values > 0.0).sum())

    @property
    def outside(self) -> bool:
        """Whether the interval of this mean leaves out zero."""
        return self.mean.low > 0.0 or self.mean.high < 0.0


@dataclass(frozen=True)
class Findings:
    """pairs: that were asked; solved: with both timings; same: of these, those whose asynchronous
    answer is the synchronous one; different: of the others, those that are not the same movements
    drawn again; slower: of the others, those whose asynchronous movement takes longer.
    comparisons: asynchronous against synchronous of the others, by natural value. agreements:
    predicted and indirect against direct, over all movements; covered: share of the movements whose
    directly measured energy lies in the predicted interval; upwards: share of those whose interval
    begins at the prediction itself. driven: movements that were measured.
    failures: why pairs have no comparison and movements no measurement, each with how many.
    """

    pairs: int
    solved: int
    same: int
    different: int
    slower: int
    comparisons: tuple[Comparison, ...]
    agreements: tuple[Comparison, ...]
    covered: float
    driven: int
    upwards: float
    failures: tuple[PairFailure, ...] = ()


def findings_of(rows: Sequence[Row]) -> Findings:
    """All comparisons over the rows of pairs."""
    both = [row for row in rows if solved(row, SYNCHRONOUS) and solved(row, ASYNCHRONOUS)]
    own = [row for row in both if row[ASYNCHRONOUS].get("timing") == ASYNCHRONOUS]
    every = [(k, row[timing]) for k, row in enumerate(rows) for timing in distinct(row)]
    measured = [(k, one) for k, one in every if math.isfinite(number(one, "direct_j"))]
    own_pair = [k for k, _ in measured]
    driven = [one for _, one in measured]
    direct = _field("direct_j")
    return Findings(
        len(rows),
        len(both),
        len(both) - len(own),
        len({_movements(row, k) for k, row in enumerate(own)}),
        sum(_is_slower(row) for row in own),
        together(
            [
                replace(compared(name, own, _of(ASYNCHRONOUS, it), _of(SYNCHRONOUS, it)), unit=unit)
                for name, it, unit in NATURAL
            ]
        ),
        together(
            [
                replace(
                    compared(name, driven, _field(field), direct, own_pair),
                    unit="J",
                )
                for name, field in AGREEMENTS
            ]
        ),
        _covered(driven),
        len(driven),
        _upwards(driven),
        failures_of(rows),
    )


def together(comparisons: Sequence[Comparison]) -> tuple[Comparison, ...]:
    """The comparisons of a table, with what is shown when all are looked at."""
    shown = shown_together([each.chance for each in comparisons])
    return tuple(replace(each, shown=one) for each, one in zip(comparisons, shown, strict=True))


def compared(
    name: str,
    rows: Sequence[Row],
    first: Callable[[Row], float],
    second: Callable[[Row], float],
    own_pair: Sequence[int] | None = None,
) -> Comparison:
    """first against second in percent over the rows that have both.

    own_pair: the pair of each row where a pair has several; its movements go between the same
    places, so that what is said of the mean and the median is taken over pairs. Where all are alike
    there is no interval.
    """
    figures = np.array([(first(row), second(row)) for row in rows]).reshape(-1, 2)
    kept = np.isfinite(figures).all(axis=1) & (figures[:, 1] != 0.0)
    values = 100.0 * (figures[kept, 0] / figures[kept, 1] - 1.0)
    values[np.abs(values) < ALIKE] = 0.0
    by_pair = values
    sides = figures[kept]
    if own_pair is not None:
        of = np.asarray(own_pair, dtype=int)[kept]
        own = [of == pair for pair in dict.fromkeys(of.tolist())]
        by_pair = np.array([values[each].mean() for each in own])
        sides = np.array([sides[each].mean(axis=0) for each in own]).reshape(-1, 2)
    of_sums = _of_sums(sides)
    mean = mean_of(of_sums)
    deviation = math.nan if alike(of_sums) else spread_of(of_sums)
    return Comparison(
        name,
        values,
        len(by_pair),
        mean,
        median_of(by_pair),
        spread_of(values),
        mean.value / deviation,
        chance_of(of_sums),
        skewed(of_sums),
        tuple(sides.mean(axis=0).tolist()) if len(sides) else (math.nan, math.nan),
    )


def _of_sums(sides: FloatArray) -> FloatArray:
    """What each pair (N,) says of the difference of the sums of both sides (N, 2), in percent: its
    mean is that difference, its spread that of a ratio of sums to first order (Cochran, Sampling
    Techniques (1977), 6.4).
    """
    if not len(sides):
        return np.empty(0)
    first, second = sides.T
    ratio = first.sum() / second.sum()
    found = 100.0 * (ratio - 1.0 + (first - ratio * second) / second.mean())
    found[np.abs(found) < ALIKE] = 0.0
    return np.asarray(found)


def _movements(row: Row, k: int) -> tuple[object, ...]:
    return tuple(row[timing].get("trajectory_id", k) for timing in (SYNCHRONOUS, ASYNCHRONOUS))


def _is_slower(row: Row) -> bool:
    own, common = (number(row[timing], "duration_s") for timing in (ASYNCHRONOUS, SYNCHRONOUS))
    return own > common * (1.0 + 0.01 * ALIKE)


def _of(timing: str, column: str) -> Callable[[Row], float]:
    return lambda row: number(row[timing], column)


def _field(column: str) -> Callable[[Row], float]:
    return lambda one: number(one, column)


def _covered(driven: Sequence[Row]) -> float:
    if not driven:
        return math.nan
    inside = [
        number(one, "predicted_low_j") <= number(one, "direct_j") <= number(one, "predicted_high_j")
        for one in driven
    ]
    return float(np.mean(inside))


def _upwards(driven: Sequence[Row]) -> float:
    if not driven:
        return math.nan
    lowest = [number(one, "predicted_low_j") >= number(one, "predicted_j") for one in driven]
    return float(np.mean(lowest))
