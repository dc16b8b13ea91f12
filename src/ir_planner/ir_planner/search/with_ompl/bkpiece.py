"""Two trees of KPIECE, from the start and from the goals (BKPIECE).

OMPL's bidirectional variant of KPIECE.
"""

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import setting
from ir_planner.search.with_ompl.ompl_search import OverCells


@dataclass(frozen=True)
class Bkpiece(OverCells):
    """Two trees of KPIECE, from the start and from the goals (BKPIECE)."""

    planner_id: ClassVar[str] = "bkpiece"
    planner: ClassVar[str] = "BKPIECE1"

    failed_score: float = setting(
        0.5,
        "What the score of a cell is multiplied by where a motion failed.",
        minimum=0.01,
        maximum=1.0,
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {**super().parameters(), "FailedExpansionCellScoreFactor": self.failed_score}
