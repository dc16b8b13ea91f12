"""A roadmap of random configurations and their neighbours (PRM); its bytes may differ from run to
run.

OMPL's planner grows and enlarges its roadmap by turns of so many milliseconds, and looks for a
solution in a
thread beside that: the same seed may give another path. That thread also adds all goals but the
first. Each needs Python for its checks, and then both wait for each other for ever; so the goals
are its starts, and the start its one goal.
Kavraki et al., "Probabilistic roadmaps for path planning in high-dimensional configuration spaces",
1996.
"""

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import setting
from ir_planner.search.with_ompl.ompl_search import OmplSearch


@dataclass(frozen=True)
class Prm(OmplSearch):
    """A roadmap of random configurations and their neighbours (PRM); its bytes may differ from run
    to run.
    """

    planner_id: ClassVar[str] = "prm"
    planner: ClassVar[str] = "PRM"
    repeatable: ClassVar[bool] = False
    reverse: ClassVar[bool] = True

    neighbours: int = setting(
        10, "Configurations that a new one is connected to.", minimum=1, maximum=1000
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"MaxNearestNeighbors": self.neighbours}
