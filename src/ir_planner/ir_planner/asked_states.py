"""Questions about states: one with its nearest pairs."""

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import StatusCode
from ir_planner.checks import StateCheck, state_check
from ir_planner.request import bounded, safety_distance, within_limits
from ir_planner.scene import PlanningScene

PAIRS_MAX = 1000


def asked_state(
    scene: PlanningScene, q: FloatArray, margin: float, max_pairs: int, station: str
) -> StateCheck:
    """Nearest pairs at q (n,), and whether all keep S_m, `margin` m, or what `station` allows.

    Raises RequestError for what makes no sense.
    """
    safety_distance(margin)
    bounded(max_pairs, 0, PAIRS_MAX, "max_pairs")
    q = within_limits(q, scene.cell, "state", StatusCode.INVALID_ROBOT_STATE)
    return state_check(q, scene, margin, max_pairs, station)
