"""Two trees that grow towards random configurations and each other (RRT-Connect).

Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path planning", 2000.
"""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.with_ompl.adapter import found_by
from ir_planner.search.with_ompl.problem import Parameters


@dataclass(frozen=True)
class RrtConnect:
    """Two trees that grow towards random configurations and each other (RRT-Connect)."""

    range: float = setting(
        1.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    edges: int = setting(
        100_000_000, "Checks in certified edges before it is given up.", minimum=1, maximum=100_000_000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """One path, or none."""
        parameters = Parameters("RRTConnect", {"Range": self.range})
        return found_by("rrt_connect", parameters, self.edges, ends, space, seed, work)
