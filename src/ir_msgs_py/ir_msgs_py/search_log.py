"""Logs of searches, as they travel with an answer: positions of the tool, reasons with counts.

A reader of an answer, or years later of its recording, can show what was tried, what was rejected
and why.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ir_values.arrays import FloatArray, IntArray

Counts = tuple[tuple[str, int], ...]


def _nowhere() -> FloatArray:
    return np.zeros((0, 3))


class WithdrawalLog(NamedTuple):
    """A withdrawal from a station (eq. 7). kept (N, 3) m: positions of the tool at the
    configurations that were kept, the station first, each with the index of its parent (N,);
    dropped (M, 3): some of those that came too near something. path (L, 3): along what was left of
    the best path. load: what was held.
    distance: the total metric distance D [m] at the station and the largest one reached. asked:
    whether the cell asks for a withdrawal there. blocked: why the straight line back along the tool
    leads nowhere from the same configuration, "": it is free, or nobody knows.
    """

    station: str
    load: str
    method: str
    generations: int
    candidates: int
    rejected: Counts
    distance: tuple[float, float]
    kept: FloatArray
    parents: IntArray
    dropped: FloatArray
    path: FloatArray
    asked: bool = False
    blocked: str = ""


class Track(NamedTuple):
    """One random start: positions (K, 3) m of the tool from sweep to sweep; why it was rejected,
    "": it was accepted.
    """

    outcome: str
    points: FloatArray


class ConfigurationLog(NamedTuple):
    """A search for configurations at a station by cyclic coordinate descent (eqs. 1 to 6): of
    `starts` random ones so many were accepted, of which so many are distinct; tracks: of the first
    starts.
    """

    station: str
    starts: int
    accepted: int
    distinct: int
    rejected: Counts
    tracks: tuple[Track, ...]


@dataclass(frozen=True, eq=False)
class CorrectionLog:
    """A genetic correction of a straight movement: positions (K, 3) m of the tool along it, along
    the parts of it that collide, and along the corrected path of least W (L, 3). fitness: by
    stretch that was corrected, of this movement and of paths on which something still collided, of
    the best individual of each generation; 1 is the cost of the straight stretch. costs: W of eq.
    (9) before and after. met: the first pair that is too near. driven (M, 3): along the movement
    that is driven, optimised from the corrected paths; empty where nobody says.
    """

    start: str
    goal: str
    generations: int
    fitness: tuple[tuple[float, ...], ...]
    costs: tuple[float, float]
    straight: FloatArray
    stretches: tuple[FloatArray, ...]
    path: FloatArray
    met: str = ""
    driven: FloatArray = field(default_factory=_nowhere)


SearchLog = WithdrawalLog | ConfigurationLog | CorrectionLog
