"""Notices of the driver to a person: sentences kept in order until they are taken."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from ir_values.errors import one_line


class Level(IntEnum):
    """How bad it is; numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class Notice(NamedTuple):
    """One sentence."""

    level: Level
    sentence: str


_KEPT = 200  # notices that wait to be taken; the oldest go first


class Notices:
    """A bounded list of notices; an immediate repetition is kept once."""

    def __init__(self) -> None:
        self._pending: deque[Notice] = deque(maxlen=_KEPT)
        self.last: Notice | None = None

    def add(self, level: Level, sentence: str) -> None:
        """Keep the notice, as one bounded line."""
        notice = Notice(level, one_line(sentence))
        if not self._pending or self._pending[-1] != notice:
            self._pending.append(notice)
        self.last = notice

    def take(self) -> list[Notice]:
        """Return what has come since the last call."""
        pending = list(self._pending)
        self._pending.clear()
        return pending


def shortened(notices: Sequence[Notice], most: int) -> list[Notice]:
    """At most so many of them in their order, errors first to stay, and how many were left out."""
    if len(notices) <= most:
        return list(notices)
    by_weight = sorted(range(len(notices)), key=lambda k: (notices[k].level is not Level.ERROR, k))
    kept = [notices[k] for k in sorted(by_weight[: most - 1])]
    return [*kept, Notice(Level.WARN, f"and {len(notices) - len(kept)} more messages")]
