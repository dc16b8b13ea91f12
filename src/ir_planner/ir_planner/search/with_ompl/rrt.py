"""One tree that grows towards random configurations (RRT).

LaValle and Kuffner, "Randomized kinodynamic planning", 2001.
"""

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import setting
from ir_planner.search.with_ompl.ompl_search import OmplSearch


@dataclass(frozen=True)
class Rrt(OmplSearch):
    """One tree that grows towards random configurations (RRT)."""

    planner_id: ClassVar[str] = "rrt"
    planner: ClassVar[str] = "RRT"

    range: float = setting(
        2.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    goal_bias: float = setting(
        0.05, "Share of the motions that aim at a goal.", minimum=0.0, maximum=1.0
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"Range": self.range, "GoalBias": self.goal_bias}
