"""Regional movement: from one free configuration to another, round everything, at least cost.

First the straight movement of all joints (PTP, cost W of eq. 9). Where it collides: simple detours, the tool
drawn back, and two trees. From the first free way on the answer gets better with work: other ways round are
looked for, and the cheapest go down by gradient to the best path and pace near them, certified. Nothing
found is an answer too: which pair is in the way, where, by how much, and what was tried.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from ir_kernels.collision import FREE
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory

from ir_planner.checks import FreeSpace, end_in_collision, pair_value
from ir_planner.optimize import Portfolio, Refinement
from ir_planner.request import Journal, Work
from ir_planner.scene import STILL, PlanningScene, path_cost
from ir_planner.search import BY_NAME_ONLY, EXPLORERS, SEARCHES, Ends, GeneticSettings, fewest_corners, pulled
from ir_planner.timing import TimedMovement

_GENETIC = GeneticSettings()
_FINISHED = 2  # drafts that are finished in one round
_TIMED_BY_LAWS = 3


@dataclass(frozen=True, eq=False)
class MovementPlan:
    """The answer to a request for a movement; trajectory None unless the status is SUCCESS."""

    status: Status
    info: PlanningInfo
    report: TrajectoryReport
    trajectory: JointTrajectory | None = None
    waypoints: FloatArray | None = None


def plan_regional(
    start: FloatArray,
    goals: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    work: Work,
    settings: GeneticSettings = _GENETIC,
) -> MovementPlan:
    """Movement from start (n,) to a goal (n,), or to the best reachable of goals (G, n), cheapest by W first.

    All within the limits. Raises RequestError for options that can't be met (duration), CancelledError when
    asked to stop.
    """
    journal = Journal(work, options.seed)
    names = scene.cell.robot.joint_names
    status, found = search_regional(start, goals, scene, options, journal, settings)
    info = journal.info(start, names)
    if found is None:
        return MovementPlan(status, info, TrajectoryReport())
    return MovementPlan(status, info, found.evaluation.report, found.trajectory, found.waypoints)


def search_regional(
    start: FloatArray,
    goals: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    journal: Journal,
    settings: GeneticSettings = _GENETIC,
) -> tuple[Status, TimedMovement | None]:
    """The best movement found, with the status that says so or says why not."""
    ends = Ends(start, np.atleast_2d(goals))
    space = FreeSpace.of(scene, options.safety_distance, journal.work)
    blocked = end_in_collision(start, ends.goals[0], space, options.safety_distance)
    if blocked is not None:
        return blocked, None
    portfolio = Portfolio(space, Refinement(scene, options, journal.work), journal)
    ways = _first_ways(ends, space, options, journal, settings)
    best: tuple[str, TimedMovement] | None = None
    there = np.abs(ends.goals - start).max(axis=1).min() < STILL
    if ways and not there and not _by_laws(options):
        _improve(ends, ways, portfolio, options, settings)
        best = portfolio.best()
        if best is None:
            portfolio.refinement.check_wish()
    if ways and best is None:
        with journal.stage("straight steps") as notes:
            cheapest = sorted(ways, key=lambda way: path_cost(scene.weights, way[1]))
            shorter = [(method, _straightened(path, space)) for method, path in cheapest[:_TIMED_BY_LAWS]]
            best = portfolio.timed_by_laws(shorter)
            notes.append("certified" if best else "nothing certified")
            if best is not None and best[1].note:
                notes.append(best[1].note)
    if best is None:
        return _blocked_status(start, ends.goals[0], space, options, journal), None
    journal.planner_id, movement = best
    return Status.success(), movement


def _by_laws(options: PlanOptions) -> bool:
    """Whether the movement is to keep to straight steps: PTP by name, or joints with a time each of their
    own.
    """
    return options.planner_id == "direct" or options.timing == "asynchronous"


def _first_ways(
    ends: Ends, space: FreeSpace, options: PlanOptions, journal: Journal, settings: GeneticSettings
) -> list[tuple[str, FloatArray]]:
    """The first free ways, by the first search that finds any."""
    wanted = [entry for entry in SEARCHES if options.planner_id in ("", entry[0])]
    wanted += [entry for entry in BY_NAME_ONLY if options.planner_id == entry[0]]
    for name, search in wanted:
        with journal.stage(name) as notes:
            found = search(ends, space, settings, options.seed)
            if found.ways:
                notes.append(f"first feasible: {len(found.ways)} free, {len(found.ways[0])} points")
            else:
                notes.append("nothing free" + (f", {found.note}" if found.note else ""))
        if found.ways:
            return [(name, path) for path in found.ways]
        if journal.work.exhausted:
            break
    return []


def _improve(
    ends: Ends,
    ways: list[tuple[str, FloatArray]],
    portfolio: Portfolio,
    options: PlanOptions,
    settings: GeneticSettings,
) -> None:
    """Refine the first ways, then look for other ways round and refine the best of all, turn by turn, until
    the work is spent.
    """
    journal = portfolio.journal
    until = journal.work.iterations + journal.work.improvement

    def more() -> bool:
        return journal.work.iterations < until and not journal.work.exhausted

    with journal.stage("refine") as notes:
        portfolio.add(ways[0][0], [way for _, way in ways])
        notes.append(f"{portfolio.finish_best(1)} certified")
    explorers = [entry for entry in EXPLORERS if options.planner_id in ("", entry[0])]
    turn = 0
    with journal.stage("improve") as notes:
        new, certified = Counter[str](), 0
        while more():
            before = journal.work.iterations
            for name, search in explorers:
                if more() and not (name == "genetic" and turn == 0 and len(explorers) > 1):
                    found = search(ends, portfolio.space, settings, _seed(options.seed, turn, name))
                    new[name] += portfolio.add(name, found.ways)
            certified += portfolio.finish_best(_FINISHED) if more() else 0
            if more():
                certified += portfolio.deepen()
            turn += 1
            if journal.work.iterations == before:
                break  # nothing left to do
        others = ", ".join(f"{count} by {name}" for name, count in new.items() if count)
        notes.append(f"{turn} turns, new ways: {others or 'none'}; {certified} certified")


def _seed(seed: int, turn: int, name: str) -> int:
    """Another seed for every search of a request."""
    words = [seed % 2**63, turn, *name.encode()]
    return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0] >> 1)


def _straightened(path: FloatArray, space: FreeSpace) -> FloatArray:
    weights = space.scene.weights
    return pulled(fewest_corners(path, space, weights), space, weights) if len(path) > 2 else path


def _blocked_status(
    start: FloatArray, goal: FloatArray, space: FreeSpace, options: PlanOptions, journal: Journal
) -> Status:
    found = space.scene.collision.certify_edges(start[None], goal[None], space.threshold)
    tried = ", ".join(f"{stage.name} ({stage.note})" for stage in journal.stages) or "nothing"
    cut = " within planning_time" if journal.work.truncated else ""
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
