"""A roadmap of random configurations and their neighbours (PRM); its bytes may differ from run to run.

OMPL's planner grows and enlarges its roadmap by turns of so many milliseconds, and looks for a solution in a
thread beside that: the same seed may give another path.
Kavraki et al., "Probabilistic roadmaps for path planning in high-dimensional configuration spaces", 1996.
"""

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.with_ompl.adapter import found_by
from ir_planner.search.with_ompl.problem import Parameters


@dataclass(frozen=True)
class Prm:
    """A roadmap of random configurations and their neighbours (PRM); its bytes may differ from run to run."""

    repeatable: ClassVar[bool] = False

    neighbours: int = setting(10, "Configurations that a new one is connected to.", minimum=1, maximum=1000)
    edges: int = setting(
        100_000_000, "Checks in certified edges before it is given up.", minimum=1, maximum=100_000_000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """One path, or none."""
        parameters = Parameters("PRM", {"MaxNearestNeighbors": self.neighbours})
        return found_by("prm", parameters, self.edges, ends, space, seed, work)
