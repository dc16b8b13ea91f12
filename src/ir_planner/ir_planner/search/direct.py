"""The straight joint movement (PTP): the path of least W (eq. 9) where it is free."""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found


@dataclass(frozen=True)
class Direct:
    """The straight movements to the goals that are free."""

    paths: int = setting(
        3, "Straight movements that are taken, to as many goals.", minimum=1, maximum=64
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """Certify the straight movement to every goal, also where no work is left: what is free at
        once is found with any work.
        """
        starts = np.repeat(ends.start[None], len(ends.goals), axis=0)
        free = np.flatnonzero(space.straight_free(starts, ends.goals))[: self.paths]
        return Found([np.stack([ends.start, goal]) for goal in ends.goals[free]])
