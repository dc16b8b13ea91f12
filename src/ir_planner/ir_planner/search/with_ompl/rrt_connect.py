"""Two trees that grow towards random configurations and each other (RRT-Connect).

Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path planning", 2000.
"""

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import setting
from ir_planner.search.with_ompl.ompl_search import OmplSearch


@dataclass(frozen=True)
class RrtConnect(OmplSearch):
    """Two trees that grow towards random configurations and each other (RRT-Connect)."""

    planner_id: ClassVar[str] = "rrt_connect"
    planner: ClassVar[str] = "RRTConnect"

    range: float = setting(
        1.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"Range": self.range}
