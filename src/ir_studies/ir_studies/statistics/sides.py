"""The two sides of a pair's row: its movement with synchronous and with asynchronous joints."""

from __future__ import annotations

import math

from ir_studies.work import Row

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
