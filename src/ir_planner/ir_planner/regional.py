"""Regional movement: from one free configuration to another, round everything, at least cost.

First the straight movement of all joints (PTP, cost W of eq. 9). Where it collides: simple detours, and as
the last resort two trees. The cheapest few by W are polished, timed and certified, and the objective
decides among them. Nothing found is an answer too: which pair is in the way, where, by how much, and what
was tried.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from ir_kernels.collision import FREE
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import DistancePair, PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_planner.budget import Budget
from ir_planner.clearance import pair_value
from ir_planner.detours import drawn_back, over_postures, scattered
from ir_planner.errors import TimingError
from ir_planner.free_space import FreeSpace
from ir_planner.journal import Journal
from ir_planner.movement import TimedMovement, timed_movement
from ir_planner.movement_cost import path_cost
from ir_planner.objective import objective_value
from ir_planner.polish import fewest_corners, pulled
from ir_planner.retreat import retreating_paths
from ir_planner.scene import PROOF_TOLERANCE, PlanningScene
from ir_planner.tree import connect

FloatArray = NDArray[np.float64]
Search = Callable[[FloatArray, FloatArray, FreeSpace, int], list[FloatArray]]
_SCATTERED = 160
_REFINED = 3  # ways round that are polished, timed and compared
_DIFFERENT = 0.15  # rad: ways whose vias are nearer are one way


@dataclass(frozen=True, eq=False)
class MovementPlan:
    """The answer to a request for a movement; trajectory None unless the status is SUCCESS."""

    status: Status
    info: PlanningInfo
    report: TrajectoryReport
    trajectory: JointTrajectory | None = None
    waypoints: FloatArray | None = None


def plan_regional(
    start: FloatArray, goal: FloatArray, scene: PlanningScene, options: PlanOptions, budget: Budget
) -> MovementPlan:
    """Movement from start to goal (n,), both within the limits.

    Raises RequestError for options that can't be met (duration), CancelledError when asked to stop.
    """
    journal = Journal(budget, options.seed)
    names = scene.cell.robot.joint_names
    status, found = search_regional(start, goal, scene, options, journal)
    info = journal.info(start, names)
    if found is None:
        return MovementPlan(status, info, TrajectoryReport())
    return MovementPlan(status, info, found.evaluation.report, found.trajectory, found.waypoints)


def search_regional(
    start: FloatArray, goal: FloatArray, scene: PlanningScene, options: PlanOptions, journal: Journal
) -> tuple[Status, TimedMovement | None]:
    """The best movement found, with the status that says so or says why not."""
    space = FreeSpace.of(scene, options.safety_distance, journal.budget)
    blocked = end_in_collision(start, goal, space, options.safety_distance)
    if blocked is not None:
        return blocked, None
    for name, search in _searches(options.planner_id):
        with journal.stage(name) as notes:
            paths = search(start, goal, space, options.seed)
            best = _best_of(paths, scene, options, journal)
            notes.append(f"{len(paths)} free" if paths else "nothing free")
            if best is not None and best.note:
                notes.append(best.note)
        if best is not None:
            journal.planner_id = name
            return Status.success(), best
        if journal.budget.truncated:
            break
    return _blocked_status(start, goal, space, options, journal), None


def _searches(planner_id: str) -> tuple[tuple[str, Search], ...]:
    known: tuple[tuple[str, Search], ...] = (
        ("direct", direct),
        ("detours", detours),
        ("retreat", retreat),
        ("tree", tree),
    )
    return tuple(entry for entry in known if planner_id in ("", entry[0]))


def direct(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """The straight movement, if it is free."""
    path = np.stack([start, goal])
    return [path] if space.edges_free(path[:1], path[1:])[0] else []


def detours(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """Free simple detours: the cheapest few by W that are different ways, polished."""
    cell, weights = space.scene.cell, space.scene.weights
    postures = [np.array(cell.park), np.array(cell.machine_home)]
    rng = np.random.default_rng(seed)
    candidates = [
        *over_postures(start, goal, postures),
        *drawn_back(start, goal, postures),
        *scattered(start, goal, space.low, space.high, _SCATTERED, rng),
    ]
    candidates = [np.clip(path, space.low, space.high) for path in candidates]
    free = space.paths_free(candidates)
    ways = [path for path, is_free in zip(candidates, free, strict=True) if is_free]
    return _polished(_different(sorted(ways, key=lambda path: path_cost(weights, path))), space)


def retreat(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """Free ways that first draw the tool back: the cheapest few that are different, polished."""
    weights = space.scene.weights
    ways = retreating_paths(start, goal, space, np.random.default_rng(seed))
    return _polished(_different(sorted(ways, key=lambda path: path_cost(weights, path))), space)


def tree(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """A free path found by two trees, polished."""
    path = connect(start, goal[None], space, seed)
    if path is None:
        return []
    for _ in range(3):
        shorter = fewest_corners(path, space, space.scene.weights)
        done = path_cost(space.scene.weights, shorter) > 0.97 * path_cost(space.scene.weights, path)
        path = shorter
        if done or space.budget.exhausted:
            break
    return _polished([path], space)


def _polished(paths: list[FloatArray], space: FreeSpace) -> list[FloatArray]:
    weights = space.scene.weights
    return [pulled(fewest_corners(path, space, weights), space, weights) for path in paths]


def _different(paths: list[FloatArray]) -> list[FloatArray]:
    """The first few paths that are not the same way round."""
    chosen: list[FloatArray] = []
    for path in paths:
        middle = path[len(path) // 2]
        if all(np.abs(middle - other[len(other) // 2]).max() > _DIFFERENT for other in chosen):
            chosen.append(path)
        if len(chosen) == _REFINED:
            break
    return chosen


def _best_of(
    paths: list[FloatArray], scene: PlanningScene, options: PlanOptions, journal: Journal
) -> TimedMovement | None:
    """The certified movement with the best objective over free paths."""
    best: TimedMovement | None = None
    for path in paths:
        try:
            found = timed_movement(path, scene, options, journal.budget)
        except TimingError as error:
            journal.reject(f"torque: {error}")
            continue
        if found.violation is not None:
            journal.reject(f"not proved: {found.violation.what}")
            continue
        value = objective_value(found.evaluation.report, options.objective, options.time_value)
        if best is None or value < objective_value(
            best.evaluation.report, options.objective, options.time_value
        ):
            best = found
    return best


def end_in_collision(
    start: FloatArray, goal: FloatArray, space: FreeSpace, safety_distance: float
) -> Status | None:
    """The status for a start or goal that is not free; None where both are."""
    for q, what, code in (
        (start, "start", StatusCode.START_STATE_IN_COLLISION),
        (goal, "goal", StatusCode.GOAL_IN_COLLISION),
    ):
        if not space.states_free(q[None])[0]:
            return Status(code, too_near(q, space, what, safety_distance))
    return None


def too_near(q: FloatArray, space: FreeSpace, what: str, safety_distance: float) -> str:
    """The sentence for a configuration (n,) in which a pair is nearer than it may be."""
    z = int(space.scene.collision.min_distance(q[None], space.threshold).pair[0])
    if z < 0:
        return f"{what} is not free"
    kept = min(safety_distance, float(space.threshold[z]) + PROOF_TOLERANCE / 2)  # a contact has its own
    return f"{what}: {too_near_sentence(pair_value(space.scene, q, z), kept)}"


def too_near_sentence(pair: DistancePair, kept: float) -> str:
    """Which pair is how near, and the distance [m] it must keep."""
    where = "in penetration" if pair.distance < 0.0 else "too near"
    return (
        f"{pair.body_a} and {pair.body_b} ({pair.kind}) are {where}: "
        f"distance {pair.distance * 1e3:.1f} mm, it must be more than {kept * 1e3:.1f} mm"
    )


def _blocked_status(
    start: FloatArray, goal: FloatArray, space: FreeSpace, options: PlanOptions, journal: Journal
) -> Status:
    found = space.scene.collision.certify_edges(start[None], goal[None], space.threshold)
    tried = ", ".join(f"{stage.name} ({stage.note})" for stage in journal.stages) or "nothing"
    cut = " within planning_time" if journal.budget.truncated else ""
    if found.verdict[0] == FREE:
        reasons = "; ".join(f"{reason} ({count})" for reason, count in journal.rejected.items())
        return Status(
            StatusCode.PLANNING_FAILED,
            f"the straight way is free but no movement could be certified: {reasons}",
        )
    share = float(found.t1[0])
    q = start + share * (goal - start)
    pair = pair_value(space.scene, q, int(found.pair[0]))
    x, y, z = space.scene.chain.tcp_poses(q[None])[0, :3, 3]
    needed = float(space.threshold[int(found.pair[0])])
    return Status(
        StatusCode.PLANNING_FAILED,
        f"no way found{cut}: on the straight movement {pair.body_a} and {pair.body_b} ({pair.kind}) come to "
        f"{pair.distance * 1e3:.1f} mm at {100 * share:.0f} % of it (tcp at {x:.2f}, {y:.2f}, {z:.2f} m), "
        f"{max(needed - pair.distance, 0.0) * 1e3:.1f} mm less than the "
        f"{needed * 1e3:.1f} mm they must keep; "
        f"tried: {tried}; another start or goal configuration, or a smaller safety distance, may help",
    )
