"""Why pairs have no movement and movements no measurement: counted by reason, with one of each in
words.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ir_studies.statistics.sides import ASYNCHRONOUS, SYNCHRONOUS, distinct, number, solved
from ir_studies.work import Row

NO_PAIR = "pairs without both movements"
NOT_DRIVEN = "movements without a measurement"
_FIGURES = re.compile(
    r"[-+]?\d[\d.,]*(?:e[-+]?\d+)?\b|\([^()]*\)"
)  # what differs where the reason is one


@dataclass(frozen=True)
class Failure:
    """what: NO_PAIR or NOT_DRIVEN; how many for the same reason, and one of them in words."""

    what: str
    count: int
    example: str


def failures_of(rows: Sequence[Row]) -> tuple[Failure, ...]:
    """All reasons, the most frequent first."""
    found: dict[tuple[str, str], list[str]] = {}
    for what, words in [*_unsolved(rows), *_not_driven(rows)]:
        found.setdefault((what, _FIGURES.sub("", words)), []).append(words)
    kept = [Failure(what, len(each), each[0]) for (what, _), each in found.items()]
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
