"""The port of a search for exit paths, as every withdrawal answers it, and what it found."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_planner.request import Work
from ir_planner.service.exit import Exit


@dataclass(frozen=True, eq=False)
class ExitsFound:
    """Free paths (M_k, n) from the interaction configuration to outside the zone; `note`: what was done.

    farthest (n,): the configuration farthest out; rejected: dropped candidates by reason.
    """

    paths: list[FloatArray]
    farthest: FloatArray
    note: str = ""
    rejected: Counter[str] = field(default_factory=Counter)


class ExitSearch(Protocol):
    """Looks for paths out of a station. Its settings are its fields."""

    @property
    def title(self) -> str:
        """The name of its stage in answers."""

    def find(self, problem: Exit, wanted: int, seed: np.random.SeedSequence, work: Work) -> ExitsFound:
        """Up to `wanted` paths whose every step `problem.inside` certifies.

        The same problem and seed give the same paths. Ends early when `work.exhausted`.
        """
