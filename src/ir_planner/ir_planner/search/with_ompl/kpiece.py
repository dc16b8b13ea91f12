"""One tree that grows where a grid over the first joints is least explored (KPIECE).

Sucan and Kavraki, "Kinodynamic motion planning by interior-exterior cell exploration", 2008.
"""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.with_ompl.adapter import found_by
from ir_planner.search.with_ompl.problem import Parameters


@dataclass(frozen=True)
class Kpiece:
    """One tree that grows where a grid over the first joints is least explored (KPIECE)."""

    range: float = setting(
        0.5, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    goal_bias: float = setting(0.05, "Share of the motions that aim at a goal.", minimum=0.0, maximum=1.0)
    border_fraction: float = setting(
        0.9, "Share of the motions that start in cells at the border.", minimum=0.01, maximum=1.0
    )
    failed_score: float = setting(
        0.5, "What the score of a cell is multiplied by where a motion failed.", minimum=0.01, maximum=1.0
    )
    cell: float = setting(
        0.3,
        "Size of the cells over the first three joints; 0: OMPL's own projection.",
        unit="rad",
        minimum=0.0,
        maximum=10.0,
    )
    edges: int = setting(
        100_000_000, "Checks in certified edges before it is given up.", minimum=1, maximum=100_000_000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """One path, or none."""
        parameters = Parameters(
            "KPIECE1",
            {
                "Range": self.range,
                "GoalBias": self.goal_bias,
                "BorderFraction": self.border_fraction,
                "FailedExpansionCellScoreFactor": self.failed_score,
            },
            self.cell,
        )
        return found_by("kpiece", parameters, self.edges, ends, space, seed, work)
