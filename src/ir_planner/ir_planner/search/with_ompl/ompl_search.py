"""What OMPL's planners have in common as searches: how they are asked, and their settings."""

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.with_ompl.adapter import found_by
from ir_planner.search.with_ompl.problem import Parameters


@dataclass(frozen=True)
class OmplSearch:
    """planner_id: name of the search; planner: OMPL's class of it; reverse: it gets the goals as
    starts.
    """

    planner_id: ClassVar[str]
    planner: ClassVar[str]
    reverse: ClassVar[bool] = False

    edges: int = setting(
        100_000_000,
        "Checks in certified edges before it is given up.",
        minimum=1,
        maximum=100_000_000,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {}

    def cells(self) -> float:
        """Size [rad] of the cells of a grid over the first joints; 0: OMPL's own."""
        return 0.0

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """One path, or none."""
        parameters = Parameters(self.planner, self.parameters(), self.cells(), self.reverse)
        return found_by(self.planner_id, parameters, self.edges, ends, space, seed, work)


@dataclass(frozen=True)
class OverCells(OmplSearch):
    """Trees that grow where a grid over the first three joints is least explored."""

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

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"Range": self.range, "BorderFraction": self.border_fraction}

    def cells(self) -> float:
        """Size [rad] of the cells."""
        return self.cell
