"""Regional movement: from one free configuration to another, around everything, at least cost.

First the straight movement of all joints (PTP, cost W of eq. 9); where it collides, the searches of
the registry. From the first free path on the answer gets better with work: guesses and paths of
many homotopy classes descend by gradient, and the cheapest to the best path and time scaling near
them, certified. Nothing found is an answer too: which pair blocks, where, by how much, and what was
tried.

One direction, each calls those below it. `Planner.plan_regional` begins at the top; programs, via
points and given trajectories, which have their configurations, begin at `search_regional`:

    plan_to_goal                         a configuration, or all free ones at a pose
    └── plan_to_configurations           the ends within limits; the answer as a MovementPlan
        └── search_regional              bound of the tilt, ends in motion, the torque reserve
            ├── _paths_between           blocked ends, then the first free paths
            │   └── _free_paths          in brief, a proof that there are none, at length
            │       └── first_paths                  exploration: one search after another
            └── _by_timing               synchronous first, then each joint with a law of its own
                └── _synchronous         what the paths lead to, over free steps for cost W
                    └── _first_that_is_certified     optimised, along a segment, in straight steps
                        └── best_found               companions: the own run, and those beside it
                            └── improve              exploration: one run, turn by turn
                                └── Portfolio        optimize: its paths, the cheapest refined
                                    └── Refinement   optimize: one path to a certified movement
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ir_kernels.collision import FREE
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import FreeSpace, end_in_collision, end_outside_cone, leans, pair_value
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.errors import RequestError
from ir_planner.optimize import Portfolio, Refinement
from ir_planner.presentation import in_mm, plot_trajectory, result_text
from ir_planner.regional.companions import (
    DIRECT,
    Answer,
    Exploration,
    best_found,
    not_worse_than_baseline,
    over_free_steps,
    slowed_where_fast,
    with_own_laws,
)
from ir_planner.regional.exploration import Path, Searches, first_paths, heeds_the_tilt
from ir_planner.regional.in_motion import search_in_motion
from ir_planner.regional.no_path import barrier, enclosure
from ir_planner.regional.rail_places import configurations_over
from ir_planner.request import Context, Goal, Journal, within_limits
from ir_planner.scene import STILL, path_cost
from ir_planner.search import Ends, fewest_corners, keeps_upright, pulled
from ir_planner.timing import (
    Movement,
    check_requested,
    with_less_reserve,
)
from ir_values.arrays import FloatArray

# What a request for a movement is answered with.


@dataclass(frozen=True, eq=False)
class MovementPlan:
    """The answer to a request for a movement; trajectory and waypoints (M, n) None unless the
    status is SUCCESS.
    """

    status: Status
    info: PlanningInfo
    report: TrajectoryReport
    trajectory: JointTrajectory | None = None
    waypoints: FloatArray | None = None

    def __repr__(self) -> str:
        identity = "" if self.trajectory is None else self.trajectory.trajectory_id
        return result_text("MovementPlan", self.status, self.report, identity)

    def plot(self) -> Any:
        """Angles and speeds of the joints over time; a matplotlib figure."""
        return plot_trajectory(self.trajectory, repr(self))


_SHARES = 101  # of a straight movement, at which a refusal looks for the largest tilt


def refusal(
    start: FloatArray, goal: FloatArray, space: FreeSpace, journal: Journal, *, path: bool
) -> Status:
    """The status for a movement from start to goal (n,), both free, that was not found; path: one
    was.
    """
    certificate = space.scene.collision.certify_edges(start[None], goal[None], space.threshold)
    tried = ", ".join(f"{stage.name} ({stage.note})" for stage in journal.stages) or "nothing"
    ceiling = journal.work.ended_by
    cut = f" within {ceiling}" if ceiling else ""
    cone = space.cone
    if cone is not None and not path and certificate.verdict[0] == FREE:
        shares = np.linspace(0.0, 1.0, _SHARES)
        tilts = cone.tilts(start + shares[:, None] * (goal - start))
        worst = int(np.argmax(tilts))
        where = f"at {100 * shares[worst]:.0f} % of the straight movement"
        sentence = leans(float(tilts[worst]), cone, where)
        return Status(
            StatusCode.PLANNING_FAILED,
            f"no path found{cut}: {sentence}; tried: {tried}; a larger tilt_max, or another start "
            "or goal configuration, may help",
        )
    if path:
        rejected = (f"{reason} ({count})" for reason, count in journal.rejected.items())
        reasons = (
            "; ".join(rejected) or "max_iterations or planning_time ended before one was timed"
        )
        which = "the straight path" if certificate.verdict[0] == FREE else "a path"
        return Status(
            StatusCode.PLANNING_FAILED,
            f"{which} is free but no movement could be certified: {reasons}",
        )
    if certificate.verdict[0] == FREE:
        return Status(
            StatusCode.PLANNING_FAILED,
            f"no path found{cut}, though the straight movement is free: tried: {tried}",
        )
    share = float(certificate.t1[0])
    q = start + share * (goal - start)
    pair = pair_value(space.scene, q, int(certificate.pair[0]))
    x, y, z = space.scene.chain.tcp_poses(q[None])[0, :3, 3]
    needed = float(space.threshold[int(certificate.pair[0])])
    distance, bound = in_mm(pair.distance, needed)
    short = in_mm(max(needed - pair.distance, 0.0), 0.0)[0]
    return Status(
        StatusCode.PLANNING_FAILED,
        f"no path found{cut}: on the straight movement {pair.body_a} and {pair.body_b} "
        f"({pair.kind}) come to {distance} mm at {100 * share:.0f} % of it (tcp "
        f"at {x:.2f}, {y:.2f}, {z:.2f} m), {short} mm below "
        f"the {bound} mm they must keep; tried: {tried}; another start or goal "
        "configuration, or a smaller safety distance, may help",
    )


# paths that get straight steps with blended corners: the cheapest by W is rarely not best
_TIMED = 3


def plan_to_goal(
    start: FloatArray, goal: Goal, context: Context, searches: Searches
) -> MovementPlan:
    """Movement from start (n,) to a configuration, or to any free one at a pose. Raises
    RequestError.
    """
    if goal.configuration is not None:
        return plan_to_configurations(start, goal.configuration[None], context, searches)
    assert goal.pose is not None  # a Goal has one of both
    scene = context.scene
    if scene.chain.first_slides and goal.rail is None:
        solutions = configurations_over(goal.pose, start, context)
    else:
        solutions = free_configurations(goal.pose, scene, context.thresholds(), start, goal.rail)
    if len(solutions.q) == 0:
        status = no_configuration(goal.pose, context.scene, solutions, goal.text or "goal")
        return MovementPlan(
            status, context.journal.info(start, context.joint_names), TrajectoryReport()
        )
    return plan_to_configurations(start, solutions.q, context, searches)


def plan_to_configurations(
    start: FloatArray, goals: FloatArray, context: Context, searches: Searches
) -> MovementPlan:
    """Movement from start (n,) to a goal (n,), or to the best reachable of goals (G, n), cheapest
    by W first.

    Raises RequestError for ends beyond a limit and for options that can't be met (duration),
    CancelledError when asked to stop.
    """
    cell = context.scene.cell
    start = within_limits(start, cell, "start", StatusCode.START_STATE_INVALID)
    goals = np.array(
        [
            within_limits(goal, cell, "goal", StatusCode.GOAL_STATE_INVALID)
            for goal in np.atleast_2d(goals)
        ]
    )
    status, movement = search_regional(start, goals, context, searches)
    info = context.journal.info(start, context.joint_names)
    if movement is None:
        return MovementPlan(status, info, TrajectoryReport())
    return MovementPlan(status, info, movement.report, movement.trajectory, movement.path)


def search_regional(
    start: FloatArray, goals: FloatArray, context: Context, searches: Searches
) -> tuple[Status, Movement | None]:
    """The best movement found, with the status that says so or says why not; start (n,), goals (n,)
    or (G, n).
    """
    context = context.upright_from(np.asarray(start))
    _check_search(context, searches)
    if context.motion is not None:
        return search_in_motion(start, np.atleast_2d(goals), context, searches)
    ends = Ends(start, np.atleast_2d(goals))
    paths = _paths_between(ends, context, searches)
    if isinstance(paths, Status):
        return paths, None
    heavy_before = context.journal.too_heavy
    movement = _by_timing(ends, list(paths), context, searches)
    if movement is None and context.journal.too_heavy > heavy_before:
        lines = [(np.asarray(start), goal) for goal in ends.goals]
        for eased in with_less_reserve(lines, context):
            movement = _by_timing(ends, list(paths), eased, searches)
            if movement is not None:
                break
    if movement is None:
        space = _space_of(context)
        return refusal(start, ends.goals[0], space, context.journal, path=True), None
    return Status.success(), movement


def _check_search(context: Context, searches: Searches) -> None:
    """Raise RequestError for a search that is asked for by name and heeds no bound of the tilt."""
    name = context.options.planner_id
    if not name or heeds_the_tilt(searches[name], context):
        return
    able = ", ".join(name for name, search in searches.items() if keeps_upright(search))
    raise RequestError(
        StatusCode.INVALID_GOAL_CONSTRAINTS,
        f"planner_id is {name} with a tilt_max of {context.options.tilt_max:g} rad: searches that "
        f"keep it are {able}, and all together without a planner_id",
    )


def _space_of(context: Context) -> FreeSpace:
    return FreeSpace.of(context.scene, context.safety_distance, context.work, cone=context.cone)


def _paths_between(ends: Ends, context: Context, searches: Searches) -> list[Path] | Status:
    """Free paths from the start to goals; a status where an end is not free, or none was found."""
    if context.options.timing == "asynchronous":
        context = context.with_timing("synchronous")
    space = _space_of(context)
    blocked = end_in_collision(ends.start, ends.goals[0], space, context.safety_distance)
    blocked = blocked or end_outside_cone(ends.start, ends.goals[0], context.cone)
    return blocked or _free_paths(ends, space, context, searches)


def _by_timing(
    ends: Ends, paths: list[Path], context: Context, searches: Searches
) -> Movement | None:
    """The best movement that free paths lead to within the context's torque reserve: synchronous,
    or each joint with a law of its own where that is asked for and serves better; None where none
    is certified.
    """
    if context.options.timing != "asynchronous":
        return _synchronous(ends, paths, context, searches)
    movement = _synchronous(ends, paths, context.with_timing("synchronous"), searches)
    return None if movement is None else with_own_laws(movement, context)


def _synchronous(
    ends: Ends, paths: list[Path], context: Context, searches: Searches
) -> Movement | None:
    """The best synchronous movement that is certified."""
    space = _space_of(context)
    best = _first_that_is_certified(Exploration(ends, paths, space, searches), context)
    if best is None:
        return None
    context.journal.planner_id, movement = best
    context.journal.timing = "synchronous"
    if context.options.objective == "movement_cost":  # W of its waypoints is asked for
        movement = over_free_steps(movement, space)
    return movement


def _free_paths(
    ends: Ends, space: FreeSpace, context: Context, searches: Searches
) -> list[Path] | Status:
    """Free paths from the start to goals; a status where there are none, or none was found."""
    paths = first_paths(ends, space, context, searches, briefly=True)
    if not paths and context.options.planner_id == "" and not context.work.exhausted:
        proved = _impossible(ends, space, context)
        if proved is not None:
            return proved
    paths = paths or first_paths(ends, space, context, searches, briefly=False)
    return paths or refusal(ends.start, ends.goals[0], space, context.journal, path=False)


def _first_that_is_certified(exploration: Exploration, context: Context) -> Answer | None:
    """The movement that the paths lead to: the best of the optimised ones and of the straight
    segment; where none of these is certified, straight steps. None where these are not either.
    """
    ends = exploration.ends
    planner_id = context.options.planner_id
    there = np.abs(ends.goals - ends.start).max(axis=1).min() < STILL
    best = None
    shortest = np.inf
    if not there and planner_id != DIRECT:
        best, shortest = best_found(exploration, context)
    if not there and planner_id == "":
        best = not_worse_than_baseline(best, exploration.paths, context)
    if best is not None:
        return slowed_where_fast(best, context)
    if np.isfinite(shortest):
        check_requested(shortest, context)
    portfolio = Portfolio(exploration.space, Refinement(context))
    return _in_straight_steps(exploration.paths, portfolio, context)


def _impossible(ends: Ends, space: FreeSpace, context: Context) -> Status | None:
    """The status of a request that provably can't be met, which searches would only find by giving
    up.
    """
    with context.journal.stage("enclosure") as notes:
        passed = barrier(ends, space)
        enclosed = enclosure(ends, space) if passed is None else None
        if passed is not None:
            notes.append(f"{passed.joint} can't pass {np.degrees(passed.value):.0f} deg")
            return passed.status
        notes.append(f"the {enclosed.end} is enclosed" if enclosed else "none is proved")
    return None if enclosed is None else enclosed.status


def _in_straight_steps(
    paths: list[Path], portfolio: Portfolio, context: Context
) -> tuple[str, Movement] | None:
    """The best of the cheapest paths by W, in straight steps with blended corners."""
    weights = context.scene.weights
    with context.journal.stage("straight steps") as notes:
        cheapest = sorted(paths, key=lambda path: path_cost(weights, path[1]))[:_TIMED]
        shorter = [(method, _straightened(path, portfolio.space)) for method, path in cheapest]
        best = portfolio.in_straight_steps(shorter)
        notes.append("certified" if best else "nothing certified")
        if best is not None and best[1].note:
            notes.append(best[1].note)
    return best


def _straightened(path: FloatArray, space: FreeSpace) -> FloatArray:
    weights = space.scene.weights
    return pulled(fewest_corners(path, space, weights), space, weights) if len(path) > 2 else path
