"""Queries of states: one with its nearest pairs, or many at once."""

from dataclasses import dataclass, replace

import numpy as np

from ir_description.robot import LIMIT_TOLERANCE
from ir_kernels.collision import MinDistance
from ir_msgs_py.report import DistancePair
from ir_msgs_py.status import StatusCode
from ir_planner.checks import StateCheck, state_check
from ir_planner.errors import RequestError
from ir_planner.program import with_doors
from ir_planner.request import bounded, check_safety_distance, joint_values, within_limits
from ir_planner.scene import END_TOLERANCE, PlanningScene
from ir_values.arrays import BoolArray, FloatArray

PAIRS_MAX = 1000
STATES_MAX = 10_000


def asked_state(
    scene: PlanningScene, q: FloatArray, margin: float, max_pairs: int, station: str
) -> StateCheck:
    """Nearest pairs at q (n,), and whether all keep S_m, `margin` m, or what `station` allows.

    Raises RequestError for what makes no sense.
    """
    check_safety_distance(margin)
    bounded(max_pairs, 0, PAIRS_MAX, "max_pairs")
    q = within_limits(q, scene.cell, "state", StatusCode.INVALID_ROBOT_STATE)
    found = state_check(q, scene, margin, max_pairs, station)
    return found if found.valid else replace(found, status=with_doors(found.status, scene))


@dataclass(frozen=True, eq=False)
class StatesCheck:
    """Of N states: valid (N,), smallest distances (N,) [m] (inf: no pair), and of each the pair
    that is nearest to violating its distance (None: no pair).
    """

    valid: BoolArray
    distances: FloatArray
    closest: tuple[DistancePair | None, ...]

    def __repr__(self) -> str:
        return f"StatesCheck({int(self.valid.sum())} of {len(self.valid)} states are free)"


def asked_states(scene: PlanningScene, q: FloatArray, margin: float, station: str) -> StatesCheck:
    """The same for many states q (N, n) at once: one call of the compiled core, two where a station
    allows contacts. Raises RequestError, which names the first bad state by its index.
    """
    check_safety_distance(margin)
    if not 1 <= len(q) <= STATES_MAX:
        raise RequestError(
            StatusCode.INVALID_ROBOT_STATE,
            f"states has {len(q)} states: it must be 1 to {STATES_MAX}",
        )
    robot = scene.cell.robot
    q = joint_values(q, (len(q), robot.n), "states", StatusCode.INVALID_ROBOT_STATE)
    low = robot.position_min - LIMIT_TOLERANCE
    high = robot.position_max + LIMIT_TOLERANCE
    bad = np.flatnonzero(~((q >= low) & (q <= high)).all(axis=1))
    if len(bad):
        within_limits(q[bad[0]], scene.cell, f"states[{bad[0]}]", StatusCode.INVALID_ROBOT_STATE)
    q = np.clip(q, robot.position_min, robot.position_max)
    threshold = scene.thresholds(margin, station)
    near = scene.collision.min_distance(q, threshold)
    there = near.pair >= 0
    kept = np.zeros(len(q))
    kept[there] = threshold[near.pair[there]]
    allowed = scene.own_distance(station)
    smallest = scene.collision.min_distance(q).distance if allowed.any() else near.distance
    valid = ~there | (near.distance > kept - END_TOLERANCE)
    return StatesCheck(valid, smallest, _pairs(near, scene, allowed))


def _pairs(
    near: MinDistance, scene: PlanningScene, allowed: BoolArray
) -> tuple[DistancePair | None, ...]:
    """The nearest pair of each state, None where there is none; allowed (Z,): pairs that the
    station lets come nearer.
    """
    pairs = scene.collision.pairs
    return tuple(
        DistancePair(
            pairs[z].kind.lower(),
            pairs[z].body_a,
            pairs[z].body_b,
            float(near.distance[k]),
            near.point_a[k],
            near.point_b[k],
            bool(allowed[z]),
        )
        if z >= 0
        else None
        for k, z in enumerate(near.pair.tolist())
    )
