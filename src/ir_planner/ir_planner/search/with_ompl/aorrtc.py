"""RRT-Connect again and again for paths that must be shorter (AORRTC).

Wilson et al., "AORRTC: almost-surely asymptotically optimal planning with RRT-Connect", 2025.
"""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.with_ompl.adapter import found_by
from ir_planner.search.with_ompl.problem import Parameters


@dataclass(frozen=True)
class Aorrtc:
    """RRT-Connect again and again for paths that must be shorter (AORRTC)."""

    range: float = setting(
        1.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    edges: int = setting(
        5_000,
        "Checks in certified edges that it goes on for: it never ends before.",
        minimum=1,
        maximum=100_000_000,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """One path, or none."""
        parameters = Parameters("AORRTC", {"Range": self.range})
        return found_by("aorrtc", parameters, self.edges, ends, space, seed, work)
