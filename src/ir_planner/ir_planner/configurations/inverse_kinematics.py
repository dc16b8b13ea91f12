"""Configurations that reach a pose: the complete closed-form set, filtered by clearance, ranked by
cost.

Rank: W of eq. (9) from a given configuration, then clearance. What is dropped is counted by the
obstructing pair.
"""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_kernels.collision import MinDistance
from ir_msgs_py.report import IkSolution
from ir_msgs_py.search_log import ConfigurationLog, Track
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import nearest_pair
from ir_planner.presentation import in_mm
from ir_planner.scene import END_TOLERANCE, PlanningScene, movement_cost
from ir_values.arrays import FloatArray, IntArray

_RAIL_APART = 0.5  # m between places of a rail that count as different
_DIFFERENT = 6  # configurations that searches look at


@dataclass(frozen=True, eq=False)
class Configurations:
    """Free configurations q (K, n), ranked; branch (K,); and why the others were dropped.

    nearest: where none is free, the obstructing pair of the one that lacks least ("" where it is
    not known). tracks, outcome: of a search from random starts, as in `Descent`; else empty.
    """

    q: FloatArray
    branch: IntArray
    reached: int
    rejected: Counter[str]
    nearest: str = ""
    tracks: tuple[FloatArray, ...] = ()
    outcome: tuple[str, ...] = ()

    def ordered(self, order: IntArray) -> "Configurations":
        """The same in another order (K,)."""
        return replace(self, q=self.q[order], branch=self.branch[order])


def joined(first: Configurations, second: Configurations) -> Configurations:
    """Free configurations of one pose at places of a rail, and those at other places."""
    return replace(
        first,
        q=np.concatenate([first.q, second.q]),
        branch=np.concatenate([first.branch, second.branch]),
        reached=first.reached + second.reached,
        rejected=first.rejected + second.rejected,
    )


def free_configurations(
    pose: FloatArray,
    scene: PlanningScene,
    threshold: FloatArray,
    near: FloatArray,
    rail: float | FloatArray | None = None,
) -> Configurations:
    """All configurations that bring the tcp to `pose` (4, 4) with every pair above its threshold
    (Z,) [m]; on a rail those at the place `rail` [m] or at places (P,), None: at places over its
    travel and at that of near (n,). Cheapest from `near` first.
    """
    places = scene.rail_places(near) if rail is None else np.atleast_1d(rail)
    found = scene.inverse_kinematics_at(places).solve(np.asarray(pose)[None])
    rejected: Counter[str] = Counter()
    if len(found.q) == 0:
        return Configurations(found.q, found.branch, 0, rejected)
    limit = threshold - END_TOLERANCE
    closest = scene.collision.min_distance(found.q, limit)
    is_free = []
    for pair, distance in zip(closest.pair, closest.distance, strict=True):
        too_near = pair >= 0 and distance <= limit[pair]
        is_free.append(not too_near)
        if too_near:
            bodies = scene.collision.pairs[pair]
            rejected[f"{bodies.body_a} too near {bodies.body_b}"] += 1
    free = np.array(is_free)
    q = found.q[free]
    branch = found.branch[free]
    margin = closest.distance[free]
    # of configurations that cost the same the one with more clearance
    cost = np.round(movement_cost(scene.weights, near, q), 6)
    order = np.lexsort((-margin, cost))
    if len(places) > 1:
        order = _varied(q[order], branch[order], order)
    nearest = "" if len(q) else _least_lacking(scene, closest, threshold)
    return Configurations(q[order], branch[order], len(found.q), rejected, nearest)


def _varied(q: FloatArray, branch: IntArray, order: IntArray) -> IntArray:
    """The order (K,) of configurations (K, 7), cheapest first, with different ones in front: other
    places of the rail, or other branches of the arm. A search takes the first few, and what is
    cheap by W on the rail need not be in joules.
    """
    first: list[int] = []
    for k in range(len(order)):
        apart = all(
            abs(q[k, 0] - q[other, 0]) >= _RAIL_APART or branch[k] != branch[other]
            for other in first
        )
        if apart:
            first.append(k)
        if len(first) == _DIFFERENT:
            break
    rest = np.setdiff1d(np.arange(len(order)), first)
    return np.asarray(order[np.concatenate([np.array(first, np.int64), rest])])


def _least_lacking(scene: PlanningScene, closest: MinDistance, threshold: FloatArray) -> str:
    lacking = threshold[closest.pair] - closest.distance
    k = int(np.argmin(lacking))
    pair = scene.collision.pairs[int(closest.pair[k])]
    distance, bound = in_mm(float(closest.distance[k]), float(threshold[closest.pair[k]]))
    return (
        f"in the best of them {pair.body_a} and {pair.body_b} come to "
        f"{distance} mm, they must keep more than {bound} mm"
    )


def no_configuration(
    pose: FloatArray, scene: PlanningScene, found: Configurations, what: str
) -> Status:
    """The status for a pose (4, 4) that no configuration reaches, or none that is free."""
    x, y, z = (float(v) for v in np.asarray(pose)[:3, 3])
    place = f"{what} at ({x:.3f}, {y:.3f}, {z:.3f}) m"
    if found.reached == 0:
        wrist = scene.chain.base_pose[:3, 3]
        away = float(portable.norm(np.array([x, y, z]) - wrist))
        return Status(
            StatusCode.NO_IK_SOLUTION,
            f"{place} can't be reached in this orientation within the joint limits (the tcp "
            f"would be {away:.2f} m from the robot's base)",
        )
    reasons = ", ".join(f"{reason} ({count})" for reason, count in found.rejected.most_common(4))
    return Status(
        StatusCode.GOAL_IN_COLLISION,
        f"{place}: {found.reached} configurations reach it, none is free: {reasons}"
        + (f"; {found.nearest}" if found.nearest else ""),
    )


def ranked_solutions(
    found: Configurations,
    pose: FloatArray,
    scene: PlanningScene,
    threshold: FloatArray,
    near: FloatArray,
) -> tuple[IkSolution, ...]:
    """The configurations with errors [m, rad] against pose (4, 4), branch, turns, clearance [m] and
    cost from `near` (n,), in the order in which they are found.
    """
    wanted = np.asarray(pose)
    solutions = []
    for q, branch in zip(found.q, found.branch, strict=True):
        T = scene.chain.tcp_poses(q[None])[0]
        R = portable.matmul(T[:3, :3].T, wanted[:3, :3])
        twist = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        sine = portable.norm(twist)
        cosine = 0.5 * (np.trace(R) - 1.0)
        turns = np.ceil((q - np.pi) / (2.0 * np.pi) - 1e-12)
        closest = nearest_pair(scene, q, threshold)
        solution = IkSolution(
            joint_names=scene.cell.robot.joint_names,
            q=q,
            position_error=float(portable.norm(T[:3, 3] - wanted[:3, 3])),
            rotation_error=float(portable.arctan2(sine, cosine)),
            branch=int(branch),
            turns=tuple(int(turn) for turn in turns),
            clearance=np.inf if closest is None else closest.distance,
            movement_cost=float(movement_cost(scene.weights, near, q)),
            closest=closest,
        )
        solutions.append(solution)
    return tuple(solutions)


_TRACKS = 64  # starts whose positions are kept: more than a picture shows


def configuration_log(
    station: str, found: Configurations, scene: PlanningScene
) -> ConfigurationLog:
    """The starts of a search at a station: where the tool was from sweep to sweep, and what ended
    them.
    """
    tracks = tuple(
        Track(outcome, scene.chain.tcp_poses(np.ascontiguousarray(q))[:, :3, 3])
        for q, outcome in zip(found.tracks[:_TRACKS], found.outcome, strict=False)
    )
    return ConfigurationLog(
        station=station,
        starts=len(found.outcome),
        accepted=sum(outcome == "" for outcome in found.outcome),
        distinct=len(found.q),
        rejected=tuple(sorted(found.rejected.items(), key=lambda item: (-item[1], item[0]))),
        tracks=tracks,
    )
