"""Where a search may go: configurations and straight joint movements whose distances all exceed
their thresholds.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels.collision import FREE, Certificates
from ir_msgs_py.report import DistancePair
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks.clearance import nearest_pairs, pair_value
from ir_planner.presentation import in_mm, status_text
from ir_planner.request import Work
from ir_planner.scene import END_TOLERANCE, PROOF_TOLERANCE, PlanningScene
from ir_values.arrays import BoolArray, FloatArray


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

    def ends_free(self, q: FloatArray) -> BoolArray:
        """Which configurations (N, n) may begin or end a movement: so free that a proof can begin
        there.
        """
        kept = self.threshold + (PROOF_TOLERANCE / 2 - END_TOLERANCE)
        return np.asarray((self.scene.collision.distances(q) > kept).all(axis=1))

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


@dataclass(frozen=True, eq=False)
class StateCheck:
    """Whether a state is free, its smallest distance [m] (inf: no pair) and the nearest pairs."""

    status: Status
    valid: bool
    min_distance: float
    pairs: tuple[DistancePair, ...]

    def __repr__(self) -> str:
        distance = f"smallest distance {1e3 * self.min_distance:.0f} mm"
        return f"StateCheck({'free' if self.valid else status_text(self.status)}, {distance})"


def state_check(
    q: FloatArray, scene: PlanningScene, margin: float, max_pairs: int, station: str = ""
) -> StateCheck:
    """Nearest pairs at q (n,), and whether all keep S_m, `margin` m (or what `station` allows)."""
    threshold = scene.thresholds(margin, station)
    distance = scene.collision.distances(q[None])[0]
    valid = bool((distance > threshold - END_TOLERANCE).all())
    pairs = nearest_pairs(scene, q, threshold, max_pairs, station)
    smallest = float(distance.min(initial=np.inf))
    if valid or not len(distance):
        return StateCheck(Status.success(), valid, smallest, pairs)
    worst = nearest_pairs(scene, q, threshold, 1, station)[0]
    kept = float(threshold[int(np.argmin(distance - threshold))])
    return StateCheck(Status.success(too_near_sentence(worst, kept)), False, smallest, pairs)


def end_in_collision(
    start: FloatArray, goal: FloatArray, space: FreeSpace, safety_distance: float
) -> Status | None:
    """The status for a start or goal (n,) that is not free; None where both are."""
    for q, what, code in (
        (start, "start", StatusCode.START_STATE_IN_COLLISION),
        (goal, "goal", StatusCode.GOAL_IN_COLLISION),
    ):
        if not space.ends_free(q[None])[0]:
            hint = "; plan_escape (ir ask escape) leads out" if what == "start" else ""
            return Status(code, too_near(q, space, what, safety_distance) + hint)
    return None


def too_near(q: FloatArray, space: FreeSpace, what: str, safety_distance: float) -> str:
    """The sentence for a configuration (n,) in which a pair is nearer than it may be."""
    z = int(space.scene.collision.min_distance(q[None], space.threshold).pair[0])
    if z < 0:
        return f"{what} is not free"
    kept = min(
        safety_distance, float(space.threshold[z]) + PROOF_TOLERANCE / 2
    )  # a contact has its own
    return f"{what}: {too_near_sentence(pair_value(space.scene, q, z), kept)}"


def first_too_near(path: FloatArray, space: FreeSpace) -> str:
    """The first pair along a path (M, n) that is nearer than it may be, as counts of what was
    rejected name it.
    """
    near = space.scene.collision.min_distance(path, space.threshold)
    for distance, z in zip(near.distance, near.pair, strict=True):
        if z >= 0 and distance <= space.threshold[z]:
            return _named(space.scene, int(z))
    found = space.scene.collision.certify_edges(path[:-1], path[1:], space.threshold)
    for z in found.pair[found.verdict != FREE]:
        return _named(space.scene, int(z))
    return "no work is left to prove it free"


def _named(scene: PlanningScene, pair: int) -> str:
    return f"{scene.collision.pairs[pair].body_a} too near {scene.collision.pairs[pair].body_b}"


def too_near_sentence(pair: DistancePair, kept: float) -> str:
    """Which pair is how near, and the distance [m] it must keep."""
    where = "in penetration" if pair.distance < 0.0 else "too near"
    distance, bound = in_mm(pair.distance, kept)
    return (
        f"{pair.body_a} and {pair.body_b} ({pair.kind}) are {where}: "
        f"distance {distance} mm, it must be more than {bound} mm"
    )
