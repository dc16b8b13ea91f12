"""One tree that grows towards random configurations (RRT).

LaValle and Kuffner, "Randomized kinodynamic planning", 2001.
"""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.with_ompl.adapter import found_by
from ir_planner.search.with_ompl.problem import Parameters


@dataclass(frozen=True)
class Rrt:
    """One tree that grows towards random configurations (RRT)."""

    range: float = setting(
        2.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    goal_bias: float = setting(0.05, "Share of the motions that aim at a goal.", minimum=0.0, maximum=1.0)
    edges: int = setting(
        100_000_000, "Checks in certified edges before it is given up.", minimum=1, maximum=100_000_000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """One path, or none."""
        parameters = Parameters("RRT", {"Range": self.range, "GoalBias": self.goal_bias})
        return found_by("rrt", parameters, self.edges, ends, space, seed, work)
