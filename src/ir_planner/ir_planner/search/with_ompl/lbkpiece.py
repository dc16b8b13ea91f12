"""Two trees of KPIECE whose motions are checked when they join both (LBKPIECE).

OMPL's BKPIECE with the lazy checks of SBL.
"""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.with_ompl.adapter import found_by
from ir_planner.search.with_ompl.problem import Parameters


@dataclass(frozen=True)
class Lbkpiece:
    """Two trees of KPIECE whose motions are checked when they join both (LBKPIECE)."""

    range: float = setting(
        0.5, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    border_fraction: float = setting(
        0.9, "Share of the motions that start in cells at the border.", minimum=0.01, maximum=1.0
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
            "LBKPIECE1", {"Range": self.range, "BorderFraction": self.border_fraction}, self.cell
        )
        return found_by("lbkpiece", parameters, self.edges, ends, space, seed, work)
