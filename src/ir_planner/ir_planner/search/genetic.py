"""The paper's regional movement as a search: the straight one, what collides corrected
genetically.
"""

from dataclasses import dataclass, replace

import numpy as np

from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.correction import corrected
from ir_planner.search.population import GeneticSettings
from ir_planner.search.port import Ends, Found
from ir_planner.search.variety import NEAREST_GOALS


@dataclass(frozen=True)
class Genetic(GeneticSettings):
    """The straight movement with what collides corrected by a population (eqs. 9, 10)."""

    def quick(self) -> "Genetic":
        """Each stretch is tried once."""
        return replace(self, attempts=1)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """Correct the straight movement to the nearest goal that it succeeds for."""
        rng = np.random.default_rng(seed)
        nearest: tuple[float, str] = (np.inf, "")
        for goal in ends.goals[:NEAREST_GOALS]:
            found = corrected(ends.start, goal, space, self, rng)
            if found.paths:
                return Found(found.paths, correction=found)
            if found.pair >= 0 and found.shortfall < nearest[0]:
                pair = space.scene.collision.pairs[found.pair]
                sentence = (
                    f"the nearest of {found.generations} generations lacks "
                    f"{found.shortfall * 1e3:.1f} mm between {pair.body_a} and {pair.body_b}"
                )
                nearest = (found.shortfall, sentence)
        return Found([], nearest[1])
