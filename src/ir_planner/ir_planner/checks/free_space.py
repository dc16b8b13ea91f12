"""Where a search may go: configurations and straight joint movements whose distances all exceed
their thresholds.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels.collision import FREE, Certificates
from ir_msgs_py.report import DistancePair
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks.distances import nearest_pairs, pair_value
from ir_planner.checks.verification import leans
from ir_planner.curves import in_short_steps
from ir_planner.presentation import in_mm, status_text
from ir_planner.request import Work
from ir_planner.scene import END_TOLERANCE, PROOF_TOLERANCE, PlanningScene, ToolCone
from ir_values.arrays import BoolArray, FloatArray

_LEAST_SCALE = 0.1  # of the first joint: the wrist still counts where it carries nothing
_SHORT = 0.2  # rad of the joint that turns most, between the points of a path that is kept upright


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Scene, thresholds (Z,) m of its pairs, and the budget that every certified edge is charged
    to. cone: in which the tool has to stay, None: there is none.
    """

    scene: PlanningScene
    threshold: FloatArray
    work: Work
    cone: ToolCone | None = None

    @staticmethod
    def of(
        scene: PlanningScene,
        safety_distance: float,
        work: Work,
        station: str = "",
        cone: ToolCone | None = None,
    ) -> "FreeSpace":
        """Free space for S_m, or what `station` allows its pairs; half of the proof's tolerance is
        kept in hand.
        """
        threshold = scene.thresholds(safety_distance, station) - PROOF_TOLERANCE / 2
        return FreeSpace(scene, threshold, work, cone)

    @property
    def low(self) -> FloatArray:
        """Lower position limits (n,) rad."""
        return self.scene.cell.robot.position_min

    @property
    def high(self) -> FloatArray:
        """Upper position limits (n,) rad."""
        return self.scene.cell.robot.position_max

    @property
    def scale(self) -> FloatArray:
        """How much each joint (n,) counts in the distance of configurations: the root of its weight
        in eq. (9), the first one's being 1.
        """
        weights = self.scene.weights
        return np.asarray(np.maximum(np.sqrt(weights / weights[0]), _LEAST_SCALE))

    def kept_upright(self, paths: list[FloatArray]) -> list[FloatArray]:
        """Paths (M, n) as they are, or in a cone as many with more points, all but the ends brought
        into it.
        """
        if self.cone is None:
            return paths
        dense = [in_short_steps(path, _SHORT) for path in paths]
        within = self.cone.brought_in(np.concatenate(dense), self.low, self.high, self.scale)
        upright = np.split(within, np.cumsum([len(path) for path in dense])[:-1])
        for path, given in zip(upright, paths, strict=True):
            path[0] = given[0]
            path[-1] = given[-1]
        return upright

    def states_free(self, q: FloatArray) -> BoolArray:
        """Which configurations (N, n) are free."""
        if len(q) == 0:
            return np.zeros(0, dtype=bool)
        free = np.asarray(self.scene.collision.is_free(q, self.threshold), dtype=bool)
        return free if self.cone is None else free & self.cone.holds(q)

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
        """Which of the straight movements (N, n) to (N, n) are proved free.

        All are looked at, however little work is left; what is left of it is spent.
        """
        self.work.spend(min(len(q0), self.work.left))
        return self._proved(q0, q1)

    def _proved(self, q0: FloatArray, q1: FloatArray) -> BoolArray:
        free = np.asarray(
            self.scene.collision.certify_edges(q0, q1, self.threshold).verdict == FREE
        )
        if self.cone is not None and free.any():
            free[free] = self.cone.edges_held(q0[free], q1[free])
        return free

    def edges_free(self, q0: FloatArray, q1: FloatArray) -> BoolArray:
        """Which of the straight movements (N, n) to (N, n) are proved free.

        Each takes one unit of work. Those for which none is left are not looked at: they count as
        not free.
        """
        result = np.zeros(len(q0), dtype=bool)
        count = min(len(q0), self.work.left)
        if count:
            self.work.spend(count)
            result[:count] = self._proved(q0[:count], q1[:count])
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


def end_outside_cone(start: FloatArray, goal: FloatArray, cone: ToolCone | None) -> Status | None:
    """The status for a start or goal (n,) at which the tool leans too far; None where it does at
    neither, or nothing is asked.
    """
    if cone is None:
        return None
    for q, what, code in (
        (start, "start", StatusCode.START_STATE_VIOLATES_PATH_CONSTRAINTS),
        (goal, "goal", StatusCode.GOAL_VIOLATES_PATH_CONSTRAINTS),
    ):
        if not cone.holds(q[None])[0]:
            return Status(code, leans(float(cone.tilts(q[None])[0]), cone, f"at the {what}"))
    return None


def too_near(q: FloatArray, space: FreeSpace, what: str, safety_distance: float) -> str:
    """The sentence for a configuration (n,) in which a pair is nearer than it may be."""
    z = int(space.scene.collision.min_distance(q[None], space.threshold).pair[0])
    if z < 0:
        return f"{what} is not free"
    # a contact has its own
    kept = min(safety_distance, float(space.threshold[z]) + PROOF_TOLERANCE / 2)
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
