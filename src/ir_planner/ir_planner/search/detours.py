"""Simple detours: over the named postures, with the arm retracted, over scattered via
configurations.
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.variety import NEAREST_GOALS, different_paths
from ir_planner.search.vias import over_postures, over_retracted_arm, scattered


@dataclass(frozen=True)
class Detours:
    """Simple detours over one or two via configurations, all certified in one batch."""

    vias: int = setting(160, "Scattered via configurations per goal.", minimum=1, maximum=100_000)

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """Certify the candidates to the nearest goals."""
        cell = space.scene.cell
        postures = [np.array(cell.park), np.array(cell.machine_home)]
        rng = np.random.default_rng(seed)
        candidates: list[FloatArray] = []
        for goal in ends.goals[:NEAREST_GOALS]:
            candidates += over_postures(ends.start, goal, postures)
            candidates += over_retracted_arm(ends.start, goal, postures)
            candidates += scattered(ends.start, goal, space.low, space.high, self.vias, rng)
        candidates = [np.clip(path, space.low, space.high) for path in candidates]
        free = space.paths_free(candidates)
        paths = [path for path, is_free in zip(candidates, free, strict=True) if is_free]
        return Found(different_paths(paths, space.scene.weights))
