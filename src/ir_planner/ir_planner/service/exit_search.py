"""The port of a search for exit paths, as every withdrawal answers it, and what it found."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ir_msgs_py.arrays import FloatArray, IntArray
from ir_planner.request import Work
from ir_planner.service.exit import Exit


@dataclass(frozen=True, eq=False)
class WalkRecord:
    """Configurations (N, n) that were kept, the interaction configuration first, each with the
    index of its parent (N,); `dropped` (M, n): those that came too near something. distance: the
    total metric distance D [m] at the interaction configuration and the largest one.
    """

    kept: FloatArray
    parents: IntArray
    dropped: FloatArray
    generations: int
    candidates: int
    distance: tuple[float, float]


@dataclass(frozen=True, eq=False)
class ExitsFound:
    """Free paths (M_k, n) from the interaction configuration to outside the zone; `note`: what was
    done.

    farthest (n,): the configuration farthest out; rejected: dropped candidates by reason. walk:
    every step of a search that goes on from configurations it has reached.
    """

    paths: list[FloatArray]
    farthest: FloatArray
    note: str = ""
    rejected: Counter[str] = field(default_factory=Counter)
    walk: WalkRecord | None = None


class ExitSearch(Protocol):
    """Looks for paths out of a station. Its settings are its fields."""

    @property
    def title(self) -> str:
        """The name of its stage in answers."""

    def find(
        self, problem: Exit, wanted: int, seed: np.random.SeedSequence, work: Work
    ) -> ExitsFound:
        """Up to `wanted` paths whose every step `problem.inside` certifies.

        The same problem and seed give the same paths. Ends early when `work.exhausted`.
        """
