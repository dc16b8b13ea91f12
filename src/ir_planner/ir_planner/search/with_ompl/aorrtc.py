"""RRT-Connect again and again for paths that must be shorter (AORRTC).

Wilson et al., "AORRTC: almost-surely asymptotically optimal planning with RRT-Connect", 2025.
"""

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import setting
from ir_planner.search.with_ompl.ompl_search import OmplSearch


@dataclass(frozen=True)
class Aorrtc(OmplSearch):
    """RRT-Connect again and again for paths that must be shorter (AORRTC)."""

    planner_id: ClassVar[str] = "aorrtc"
    planner: ClassVar[str] = "AORRTC"

    range: float = setting(
        1.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    edges: int = setting(
        5_000,
        "Checks in certified edges that it goes on for: it never ends before.",
        minimum=1,
        maximum=100_000_000,
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"Range": self.range}
