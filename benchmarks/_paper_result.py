"""What an experiment on a claim of the paper answers: statements with intervals, and a verdict for
each.

A statement names a figure and the bound from which on the paper is right. It holds where the whole
95 % interval keeps the bound, it does not where none of it does, else it can't be decided. An
experiment runs with
several seeds, which share nothing: where one of them alone says otherwise, it can't be decided
either. What can't be decided says how much larger a sample would decide it, if its figure stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

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
        bound: it narrows with the root of the sample. Inf where the figure is the bound, nan
        without a width.
        """
        gap = abs(self.value - self.bound)
        width = self.value - self.low if self.value > self.bound else self.high - self.value
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
