"""Service movement, stage one: the goal configurations at the interaction point by the paper's
search.

p random starts (eq. 1), cyclic coordinate descent with metric distances (eqs. 2 to 5), acceptance
and rejection (eq. 6). It needs no closed form, so it works for any chain; what it finds is a sample
of the complete set, made distinct and ranked as that is.
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.report import IkSolution, PlanningInfo
from ir_msgs_py.status import Status, StatusCode
from ir_planner.configurations.ccd_search import InteractionSettings, descend
from ir_planner.configurations.inverse_kinematics import (
    Configurations,
    free_configurations,
    no_configuration,
    ranked_solutions,
)
from ir_planner.errors import RequestError
from ir_planner.presentation import status_text
from ir_planner.request import Context, Goal, Work
from ir_planner.scene import PROOF_TOLERANCE, PlanningScene, movement_cost
from ir_values.arrays import FloatArray, IntArray

STARTS_MAX = 10_000
_SIGMAS = 3.0  # mid-range to limit, in standard deviations: sigma is a sixth of the range
_SAME = 1e-3  # rad: configurations nearer to each other are one


def random_starts(
    low: FloatArray, high: FloatArray, count: int, distribution: str, rng: np.random.Generator
) -> FloatArray:
    """Eq. (1): starts (p, n) within [low, high] (n,): truncated normal about mid-range, or
    uniform.
    """
    if distribution == "uniform":
        return rng.uniform(low, high, (count, len(low)))
    z = rng.standard_normal((count, len(low)))
    beyond = np.abs(z) > _SIGMAS
    while beyond.any():
        z[beyond] = rng.standard_normal(int(beyond.sum()))
        beyond = np.abs(z) > _SIGMAS
    return np.asarray(0.5 * (low + high) + z * (high - low) / (2.0 * _SIGMAS))


def searched_configurations(
    pose: FloatArray,
    scene: PlanningScene,
    threshold: FloatArray,
    near: FloatArray,
    starts: int,
    seed: int,
    settings: InteractionSettings,
    work: Work,
) -> Configurations:
    """Free configurations that bring the tcp to `pose` (4, 4), found from `starts` random starts.

    Ranked by W from `near` (n,), then by clearance; `reached` counts the starts that arrived.
    Raises RequestError for a robot on a rail.
    """
    robot = scene.cell.robot
    if robot.rail is not None:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"coordinate descent turns joints, {robot.rail.name} slides: configurations on a rail "
            "are those of the closed form (analytic)",
        )
    rng = np.random.default_rng(seed)
    first = random_starts(
        robot.position_min, robot.position_max, starts, settings.distribution, rng
    )
    limit = threshold - PROOF_TOLERANCE / 2
    found = descend(pose, first, scene, limit, settings, work)
    q = distinct_configurations(found.q)
    margin = scene.collision.min_distance(q, limit).distance if len(q) else np.zeros(0)
    order = np.lexsort((-margin, np.round(movement_cost(scene.weights, near, q), 6)))
    q = np.ascontiguousarray(q[order])
    return Configurations(
        q,
        branches(q, scene),
        found.reached,
        found.rejected,
        tracks=tuple(found.tracks),
        outcome=tuple(found.outcome),
    )


def distinct_configurations(q: FloatArray) -> FloatArray:
    """The configurations (K, n) without those that are another one again."""
    chosen: list[int] = []
    for k in range(len(q)):
        if not chosen or np.abs(q[chosen] - q[k]).max(axis=1).min() > _SAME:
            chosen.append(k)
    return np.ascontiguousarray(q[chosen])


def branches(q: FloatArray, scene: PlanningScene) -> IntArray:
    """Branch (K,) of configurations (K, n): that of the closed-form solution which is the same."""
    result = np.zeros(len(q), dtype=np.int64)
    if len(q) == 0:
        return result
    closed = scene.inverse_kinematics.solve(scene.chain.tcp_poses(q))
    for k in range(len(q)):
        rows = np.flatnonzero(closed.pose_index == k)
        if len(rows):
            result[k] = closed.branch[rows[np.argmin(np.abs(closed.q[rows] - q[k]).max(axis=1))]]
    return result


IK_METHODS = ("analytic", "ccd")


@dataclass(frozen=True, eq=False)
class IkAnswer:
    """Ranked solutions; empty with a status that says why."""

    status: Status
    solutions: tuple[IkSolution, ...]
    info: PlanningInfo

    def __repr__(self) -> str:
        if not self.solutions:
            return f"IkAnswer({status_text(self.status)})"
        best = self.solutions[0]
        first = f"W {best.movement_cost:.0f}, clearance {1e3 * best.clearance:.0f} mm"
        return f"IkAnswer({len(self.solutions)} solutions, the first: {first})"


def configurations_at(
    goal: Goal, near: FloatArray, context: Context, starts: int, settings: InteractionSettings
) -> IkAnswer:
    """Free configurations that reach the goal's pose, ranked by W from `near` (n,), by the method
    that the journal names: all of them (analytic), or those found from random starts (ccd).

    Raises RequestError for a goal without a pose.
    """
    if goal.pose is None:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            "goal is a configuration: compute_ik takes a pose or a station",
        )
    scene = context.scene
    journal = context.journal
    threshold = context.at(goal.station).thresholds()
    with journal.stage("closed form" if journal.planner_id == "analytic" else "ccd") as notes:
        if journal.planner_id == "analytic":
            found = free_configurations(goal.pose, scene, threshold, near, goal.rail)
        else:
            found = searched_configurations(
                goal.pose, scene, threshold, near, starts, journal.seed, settings, context.work
            )
        notes.append(f"{found.reached} reach the pose")
    journal.rejected.update(found.rejected)
    info = journal.info(near, context.joint_names)
    if len(found.q) == 0:
        return IkAnswer(no_configuration(goal.pose, scene, found, goal.text or "goal"), (), info)
    return IkAnswer(
        Status.success(), ranked_solutions(found, goal.pose, scene, threshold, near), info
    )
