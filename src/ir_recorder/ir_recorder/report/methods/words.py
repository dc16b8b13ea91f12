"""Counted reasons as people read them."""

from __future__ import annotations

from ir_msgs_py.search_log import Counts

_SHOWN = 3


def reasons(counts: Counts) -> str:
    """The most frequent reasons: "28 gear_held too near belt, 7 not converged, 4 others"."""
    ordered = sorted(counts, key=lambda item: (-item[1], item[0]))
    parts = [f"{count} {reason}" for reason, count in ordered[:_SHOWN]]
    left = sum(count for _, count in ordered[_SHOWN:])
    return ", ".join([*parts, *([f"{left} others"] if left else [])])
