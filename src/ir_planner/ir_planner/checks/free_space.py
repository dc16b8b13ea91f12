"""Where a search may go: configurations and straight joint movements whose distances all exceed
their thresholds.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels.collision import FREE, Certificates
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_planner.request import Work
from ir_planner.scene import PROOF_TOLERANCE, PlanningScene


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Scene, thresholds (Z,) m of its pairs, and the budget that every certified edge is charged
    to.
    """

    scene: PlanningScene
    threshold: FloatArray
    work: Work

    @staticmethod
    def of(
        scene: PlanningScene, safety_distance: float, work: Work, station: str = ""
    ) -> "FreeSpace":
        """Free space for S_m, or what `station` allows its pairs; half of the proof's tolerance is
        kept in hand.
        """
        return FreeSpace(
            scene, scene.thresholds(safety_distance, station) - PROOF_TOLERANCE / 2, work
        )

    @property
    def low(self) -> FloatArray:
        """Lower position limits (n,) rad."""
        return self.scene.cell.robot.position_min

    @property
    def high(self) -> FloatArray:
        """Upper position limits (n,) rad."""
        return self.scene.cell.robot.position_max

    def states_free(self, q: FloatArray) -> BoolArray:
        """Which configurations (N, n) are free."""
        if len(q) == 0:
            return np.zeros(0, dtype=bool)
        return np.asarray(self.scene.collision.is_free(q, self.threshold), dtype=bool)

    def certificates(self, q0: FloatArray, q1: FloatArray) -> Certificates:
        """Certificates of the straight movements (N, n) to (N, n)."""
        self.work.spend(len(q0))
        return self.scene.collision.certify_edges(q0, q1, self.threshold)

    def straight_free(self, q0: FloatArray, q1: FloatArray) -> BoolArray:
        """Which of the straight movements (N, n) to (N, n) are proved free, also where no work is
        left: they take what there is of it.
        """
        self.work.spend(min(len(q0), self.work.left))
        return np.asarray(
            self.scene.collision.certify_edges(q0, q1, self.threshold).verdict == FREE
        )

    def edges_free(self, q0: FloatArray, q1: FloatArray) -> BoolArray:
        """Which of the straight movements (N, n) to (N, n) are proved free; those are not for which
        no work is left.
        """
        result = np.zeros(len(q0), dtype=bool)
        count = min(len(q0), self.work.left)
        if count:
            result[:count] = self.certificates(q0[:count], q1[:count]).verdict == FREE
        return result

    def paths_free(self, paths: list[FloatArray]) -> BoolArray:
        """Which paths (M_k, n) are free in all their steps; configurations are asked first, they
        are cheaper.
        """
        result = np.ones(len(paths), dtype=bool)
        inner = [path[1:-1] for path in paths]
        owner = np.repeat(np.arange(len(paths)), [len(points) for points in inner])
        if len(owner):
            result[owner[~self.states_free(np.concatenate(inner))]] = False
        left = np.flatnonzero(result)
        if len(left):
            owner = np.repeat(left, [len(paths[k]) - 1 for k in left])
            q0 = np.concatenate([paths[k][:-1] for k in left])
            q1 = np.concatenate([paths[k][1:] for k in left])
            result[owner[~self.edges_free(q0, q1)]] = False
        return result
