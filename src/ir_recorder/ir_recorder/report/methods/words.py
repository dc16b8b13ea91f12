"""Counted things as people read them."""

from __future__ import annotations

from ir_msgs_py.search_log import Counts

_SHOWN = 3


def counted(number: int, one: str, several: str = "") -> str:
    """A number with its noun: "1 generation", "4 generations"."""
    return f"{number} {one if number == 1 else several or one + 's'}"


def were(number: int, what: str) -> str:
    """What became of so many: "1 was kept", "3 were kept"."""
    return f"{number} {'was' if number == 1 else 'were'} {what}"


def reasons(counts: Counts) -> str:
    """The most frequent reasons: "28 gear_held too near belt, 7 not converged, 4 for other
    reasons".
    """
    ordered = sorted(counts, key=lambda item: (-item[1], item[0]))
    shown = ordered if len(ordered) == _SHOWN + 1 else ordered[:_SHOWN]
    parts = [f"{count} {reason}" for reason, count in shown]
    left = sum(count for _, count in ordered[len(shown) :])
    return ", ".join([*parts, *([f"{left} for other reasons"] if left else [])])
