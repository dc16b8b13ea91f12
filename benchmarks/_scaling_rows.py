"""Rows of benchmarks/scaling.py, and the exponents that follow from them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from _scaling_measure import Cost, exponent


@dataclass(frozen=True)
class Row:
    """One step at one size of its axis: median over the seeds."""

    axis: str
    step: str
    size: float
    seconds: float
    megabytes: float


def row_of(axis: str, step: str, found: Sequence[tuple[float, Cost]]) -> Row:
    """The row of one step from its measurements at one size."""
    size, seconds, megabytes = (
        float(np.median(values))
        for values in (
            [size for size, _ in found],
            [cost.seconds for _, cost in found],
            [cost.megabytes for _, cost in found],
        )
    )
    return Row(axis, step, size, seconds, megabytes)


def exponents(rows: Iterable[Row]) -> dict[tuple[str, str], float]:
    """Exponent of the time of each step."""
    by_step: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        by_step.setdefault((row.axis, row.step), []).append(row)
    return {
        key: exponent([row.size for row in mine], [row.seconds for row in mine])
        for key, mine in by_step.items()
    }
