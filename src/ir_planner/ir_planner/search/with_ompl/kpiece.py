"""One tree that grows where a grid over the first joints is least explored (KPIECE).

Sucan and Kavraki, "Kinodynamic motion planning by interior-exterior cell exploration", 2008.
"""

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import setting
from ir_planner.search.with_ompl.ompl_search import OverCells


@dataclass(frozen=True)
class Kpiece(OverCells):
    """One tree that grows where a grid over the first joints is least explored (KPIECE)."""

    planner_id: ClassVar[str] = "kpiece"
    planner: ClassVar[str] = "KPIECE1"

    goal_bias: float = setting(
        0.05, "Share of the motions that aim at a goal.", minimum=0.0, maximum=1.0
    )
    failed_score: float = setting(
        0.5,
        "What the score of a cell is multiplied by where a motion failed.",
        minimum=0.01,
        maximum=1.0,
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {
            **super().parameters(),
            "GoalBias": self.goal_bias,
            "FailedExpansionCellScoreFactor": self.failed_score,
        }
