"""Configurations at a station that a service movement may start from: one per branch, the best
first.
"""

from dataclasses import dataclass

import numpy as np

from ir_description import Station
from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import FreeSpace, too_near
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.errors import RequestError
from ir_planner.request import Context

EXIT = "exit"
ENTRY = "entry"
CANDIDATES_MAX = 20  # trajectories in one answer
_BRANCHES = 4  # configurations that are tried: each that fails costs a whole search
_SAME_BRANCH = 1e-6  # rad


@dataclass(frozen=True, eq=False)
class ServiceRequest:
    """configuration (n,): at the station, None: the best. near (n,): where the cost of
    configurations counts from.
    """

    station: Station
    direction: str
    configuration: FloatArray | None
    near: FloatArray
    max_candidates: int = 3


def checked_request(direction: str, max_candidates: int) -> None:
    """Raise RequestError for a direction or a number of candidates that makes no sense."""
    if direction not in (EXIT, ENTRY):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"direction {direction[:60]!a} is unknown: known are {EXIT}, {ENTRY}",
        )
    if not 1 <= max_candidates <= CANDIDATES_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"max_candidates is {max_candidates}: it must be in [1, {CANDIDATES_MAX}]",
        )


def work_configurations(
    request: ServiceRequest, context: Context
) -> tuple[list[FloatArray], Status]:
    """Free configurations (n,) at the station to start from, one per branch, best first; or none
    and why.
    """
    scene = context.scene
    margin = context.safety_distance
    name = request.station.name
    inside = FreeSpace.of(scene, margin, context.work, name)
    if request.configuration is not None:
        q = request.configuration
        if inside.states_free(q[None])[0]:
            return [q], Status.success()
        entering = request.direction == ENTRY
        code = StatusCode.GOAL_IN_COLLISION if entering else StatusCode.START_STATE_IN_COLLISION
        return [], Status(code, too_near(q, inside, "goal" if entering else "start", margin))
    found = free_configurations(request.station.pose, scene, inside.threshold, request.near)
    context.journal.rejected.update(found.rejected)
    if len(found.q) == 0:
        status = no_configuration(request.station.pose, scene, found, f"station {name}")
        return [], Status(
            status.code, status.message + _best_clearance(request.station.pose, inside)
        )
    chosen: list[FloatArray] = []
    for q in found.q:
        if all(np.abs(portable.sin(0.5 * (q - other))).max() > _SAME_BRANCH for other in chosen):
            chosen.append(q)
    return chosen[:_BRANCHES], Status.success()


def _best_clearance(pose: FloatArray, inside: FreeSpace) -> str:
    """What the freest of the configurations that reach a pose comes to; "" where none reaches
    it.
    """
    q = inside.scene.inverse_kinematics.solve(np.asarray(pose)[None]).q
    if len(q) == 0:
        return ""
    near = inside.scene.collision.min_distance(q, inside.threshold)
    best = int(np.argmax(near.distance - inside.threshold[near.pair]))
    pair = inside.scene.collision.pairs[int(near.pair[best])]
    return (
        f"; the best clearance is {near.distance[best] * 1e3:.1f} mm between {pair.body_a} and "
        f"{pair.body_b}, it must be more than {inside.threshold[near.pair[best]] * 1e3:.1f} mm"
    )
