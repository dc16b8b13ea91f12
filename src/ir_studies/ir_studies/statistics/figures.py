"""What the rows say together: paired comparisons with intervals and effect sizes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_recorder.analysis.agreement import Mean, mean_of
from ir_studies.work import Row

SYNCHRONOUS, ASYNCHRONOUS = "synchronous", "asynchronous"
NATURAL = (
    ("duration", "duration_s"),
    ("energy, predicted", "predicted_j"),
    ("energy, direct", "direct_j"),
    ("energy, indirect", "indirect_j"),
    ("peak power", "peak_w"),
    ("path of the tcp", "path_m"),
    ("W of eq. (9)", "movement_cost"),
    ("largest torque share", "torque_share"),
)
"""Natural values of section VI: what can be read off a movement, with the column that holds it."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Relative differences in percent: their mean over pairs with its 90 % interval by Student's t, median,
    and standard deviation; effect: mean over standard deviation (Cohen's d of paired samples); less: share of
    the pairs in which the first is smaller.
    """

    name: str
    values: FloatArray
    mean: Mean
    median: float
    spread: float
    effect: float
    less: float

    @property
    def count(self) -> int:
        """Pairs."""
        return len(self.values)

    @property
    def shown(self) -> bool:
        """Whether a difference is shown: the interval of the mean leaves out zero."""
        return self.mean.low > 0.0 or self.mean.high < 0.0


@dataclass(frozen=True)
class Findings:
    """pairs: that were asked; solved: with both timings; same: of these, those whose asynchronous answer is
    the synchronous one. comparisons: asynchronous against synchronous of the others, by natural value.
    agreements: predicted and indirect against direct, over all movements; covered: share of the movements
    whose directly measured energy lies in the predicted interval. driven: movements that were driven.
    """

    pairs: int
    solved: int
    same: int
    comparisons: tuple[Comparison, ...]
    agreements: tuple[Comparison, ...]
    covered: float
    driven: int


def findings_of(rows: Sequence[Row]) -> Findings:
    """All comparisons over the rows of pairs."""
    both = [row for row in rows if solved(row, SYNCHRONOUS) and solved(row, ASYNCHRONOUS)]
    own = [row for row in both if row[ASYNCHRONOUS].get("timing") == ASYNCHRONOUS]
    every = [(k, row[timing]) for k, row in enumerate(rows) for timing in distinct(row)]
    measured = [(k, one) for k, one in every if math.isfinite(number(one, "direct_j"))]
    own_pair, driven = [k for k, _ in measured], [one for _, one in measured]
    return Findings(
        len(rows),
        len(both),
        len(both) - len(own),
        tuple(
            compared(name, own, _of(ASYNCHRONOUS, column), _of(SYNCHRONOUS, column))
            for name, column in NATURAL
        ),
        (
            compared("predicted against direct", driven, _field("predicted_j"), _field("direct_j"), own_pair),
            compared("indirect against direct", driven, _field("indirect_j"), _field("direct_j"), own_pair),
        ),
        _covered(driven),
        len(driven),
    )


def solved(row: Row, timing: str) -> bool:
    """Whether a certified movement was found with this timing."""
    return bool(row.get(timing, {}).get("solved", False))


def distinct(row: Row) -> list[str]:
    """Timings of a row with a movement of their own: the asynchronous answer may be the synchronous one."""
    found = [timing for timing in (SYNCHRONOUS, ASYNCHRONOUS) if solved(row, timing)]
    alike = len(found) == 2 and row[ASYNCHRONOUS].get("timing") != ASYNCHRONOUS
    return found[:1] if alike else found


def number(one: Row, name: str) -> float:
    """A figure of a movement, NaN where there is none."""
    value = one.get(name, math.nan)
    return float(value) if isinstance(value, int | float) else math.nan


def compared(
    name: str,
    rows: Sequence[Row],
    first: Callable[[Row], float],
    second: Callable[[Row], float],
    own_pair: Sequence[int] | None = None,
) -> Comparison:
    """first / second - 1 in percent over the rows that have both.

    own_pair: the pair of each row where a pair has several; its movements go between the same places, so that
    the mean and its interval are those over pairs.
    """
    figures = np.array([(first(row), second(row)) for row in rows]).reshape(-1, 2)
    kept = np.isfinite(figures).all(axis=1) & (figures[:, 1] != 0.0)
    values = 100.0 * (figures[kept, 0] / figures[kept, 1] - 1.0)
    by_pair = values
    if own_pair is not None:
        of = np.asarray(own_pair, dtype=int)[kept]
        by_pair = np.array([values[of == pair].mean() for pair in dict.fromkeys(of.tolist())])
    spread = float(values.std(ddof=1)) if len(values) > 1 else math.nan
    return Comparison(
        name,
        values,
        mean_of(by_pair),
        float(np.median(values)) if len(values) else math.nan,
        spread,
        float(values.mean()) / spread if spread > 0.0 else math.nan,
        float((values < 0.0).mean()) if len(values) else math.nan,
    )


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
