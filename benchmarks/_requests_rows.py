"""What a kind of request is asked in benchmarks/requests.py: one row for each generated case."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

NOT_ASKED = float("nan")


@dataclass(frozen=True)
class Row:
    """case: what was asked, in words. refused: why nothing was answered, "" where something was.
    objections: what independent judges found wrong with a certified answer. seconds: of processor
    time; joules: what the objective counts, J. peer_joules: of the peer's answer to the same case,
    NOT_ASKED where it found none or there is no peer. peer_only: a peer found what was refused.
    """

    case: str
    refused: str
    certified: bool
    objections: tuple[str, ...]
    seconds: float
    joules: float = NOT_ASKED
    peer_joules: float = NOT_ASKED
    peer_only: bool = False


class Kind(Protocol):
    """A module `_requests_<kind>.py`: its docstring says what is asked, who judges, who the peer
    is.
    """

    __doc__: str

    def rows(self, count: int) -> Iterable[Row]:
        """So many generated cases; the first ones are the same whatever the count."""


def summary(name: str, rows: list[Row]) -> dict[str, Any]:
    """The figures of a kind: how many were solved, refused (and would have been solved by a peer),
    objected to; medians of milliseconds and of J over the peer's.
    """
    solved = [row for row in rows if not row.refused]
    beside = [row.joules / row.peer_joules for row in solved if row.peer_joules > 0.0]
    return {
        "kind": name,
        "cases": len(rows),
        "solved": len(solved),
        "certified": sum(row.certified for row in solved),
        "refused": len(rows) - len(solved),
        "peer only": sum(row.peer_only for row in rows),
        "objections": sum(bool(row.objections) for row in rows),
        "ms": 1e3 * statistics.median(row.seconds for row in rows) if rows else NOT_ASKED,
        "beside": len(beside),
        "J over peer": statistics.median(beside) if beside else NOT_ASKED,
    }


def reasons(rows: list[Row]) -> Iterator[str]:
    """Why cases were refused, and what judges objected to, most frequent first."""
    for title, words in (
        ("refused", [row.refused for row in rows if row.refused]),
        ("objection", [said for row in rows for said in row.objections]),
    ):
        for sentence, count in Counter(words).most_common(8):
            yield f"{title} {count}: {sentence}"
