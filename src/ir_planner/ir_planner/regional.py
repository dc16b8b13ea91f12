"""Regional movement: from one free configuration to another, round everything, at least cost.

First the straight movement of all joints (PTP, cost W of eq. 9). Where it collides: simple detours, the tool
drawn back, and two trees. From the first free way on the answer gets better with work: other ways round are
looked for, and the cheapest go down by gradient to the best path and pace near them, certified. Nothing
found is an answer too: which pair is in the way, where, by how much, and what was tried.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from ir_kernels.collision import FREE
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import DistancePair, PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_planner.budget import Budget
from ir_planner.clearance import pair_value
from ir_planner.correction import corrected
from ir_planner.detours import drawn_back, over_postures, scattered
from ir_planner.free_space import FreeSpace
from ir_planner.journal import Journal
from ir_planner.movement import TimedMovement
from ir_planner.movement_cost import path_cost
from ir_planner.polish import fewest_corners, pulled
from ir_planner.portfolio import Portfolio
from ir_planner.refinement import Refinement
from ir_planner.regional_settings import GeneticSettings
from ir_planner.retreat import retreating_paths
from ir_planner.scene import PROOF_TOLERANCE, PlanningScene
from ir_planner.timing import STILL
from ir_planner.tree import connect

FloatArray = NDArray[np.float64]
Search = Callable[[FloatArray, FloatArray, FreeSpace, int], list[FloatArray]]
Searches = tuple[tuple[str, Search], ...]
_GENETIC = GeneticSettings()
_SCATTERED = 160
_WAYS = 3  # different ways round of one search
_FINISHED = 2  # drafts that are finished in one round
_TIMED_BY_LAWS = 3
_SHORT_TREE = 4000  # edges
_ROUNDS = 10_000  # the work ends them
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
    start: FloatArray,
    goal: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    budget: Budget,
    settings: GeneticSettings = _GENETIC,
) -> MovementPlan:
    """Movement from start to goal (n,), both within the limits; `settings` of the planner `genetic`.

    Raises RequestError for options that can't be met (duration), CancelledError when asked to stop.
    """
    journal = Journal(budget, options.seed)
    names = scene.cell.robot.joint_names
    status, found = search_regional(start, goal, scene, options, journal, settings)
    info = journal.info(start, names)
    if found is None:
        return MovementPlan(status, info, TrajectoryReport())
    return MovementPlan(status, info, found.evaluation.report, found.trajectory, found.waypoints)


def search_regional(
    start: FloatArray,
    goal: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    journal: Journal,
    settings: GeneticSettings = _GENETIC,
) -> tuple[Status, TimedMovement | None]:
    """The best movement found, with the status that says so or says why not."""
    space = FreeSpace.of(scene, options.safety_distance, journal.budget)
    blocked = end_in_collision(start, goal, space, options.safety_distance)
    if blocked is not None:
        return blocked, None
    portfolio = Portfolio(space, Refinement(scene, options, journal.budget), journal)
    searches, explorers = SEARCHES, EXPLORERS
    if options.planner_id == "genetic":
        searches = explorers = (("genetic", partial(genetic, settings=settings, journal=journal)),)
    ways = _first_ways(start, goal, space, options, journal, searches)
    best: tuple[str, TimedMovement] | None = None
    if ways and np.abs(goal - start).max() >= STILL and not _by_laws(options):
        _improve(start, goal, ways, portfolio, options, explorers)
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
        return _blocked_status(start, goal, space, options, journal), None
    journal.planner_id, movement = best
    return Status.success(), movement


def _by_laws(options: PlanOptions) -> bool:
    """Whether the movement is to keep to straight steps: PTP by name, or joints with a time each of their
    own.
    """
    return options.planner_id == "direct" or options.timing == "asynchronous"


def _first_ways(
    start: FloatArray,
    goal: FloatArray,
    space: FreeSpace,
    options: PlanOptions,
    journal: Journal,
    searches: Searches,
) -> list[tuple[str, FloatArray]]:
    """The first free ways, by the first search that finds any."""
    for name, search in searches:
        if options.planner_id not in ("", name):
            continue
        with journal.stage(name) as notes:
            paths = search(start, goal, space, options.seed)
            points = f"{len(paths)} free, {len(paths[0])} points" if paths else ""
            notes.append(f"first feasible: {points}" if paths else "nothing free")
        if paths:
            return [(name, path) for path in paths]
        if journal.budget.exhausted:
            break
    return []


def _improve(
    start: FloatArray,
    goal: FloatArray,
    ways: list[tuple[str, FloatArray]],
    portfolio: Portfolio,
    options: PlanOptions,
    explorers: Searches,
) -> None:
    """Refine the first ways, look for other ways round, and refine the best of all until the work is
    spent.
    """
    journal = portfolio.journal
    until = journal.budget.iterations + journal.budget.improvement

    def more() -> bool:
        return journal.budget.iterations < until and not journal.budget.exhausted

    with journal.stage("refine") as notes:
        portfolio.add(ways[0][0], [way for _, way in ways])
        notes.append(f"{portfolio.finish_best(1)} certified")
    others = [entry for entry in explorers if options.planner_id in ("", entry[0])]
    for turn in range(_ROUNDS):
        for name, search in others:
            if not more():
                return
            with journal.stage(f"{name} again" if turn else f"other ways: {name}") as notes:
                found = search(start, goal, portfolio.space, _seed(options.seed, turn, name))
                notes.append(f"{len(found)} free, {portfolio.add(name, found)} new")
        with journal.stage("refine") as notes:
            notes.append(f"{portfolio.finish_best(_FINISHED) if more() else 0} certified")
            if more():
                portfolio.deepen()


def _seed(seed: int, turn: int, name: str) -> int:
    """Another seed for every search of a request."""
    words = [seed % 2**63, turn, *name.encode()]
    return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0] >> 1)


def _straightened(path: FloatArray, space: FreeSpace) -> FloatArray:
    weights = space.scene.weights
    return pulled(fewest_corners(path, space, weights), space, weights) if len(path) > 2 else path


def direct(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """The straight movement, if it is free."""
    path = np.stack([start, goal])
    return [path] if space.edges_free(path[:1], path[1:])[0] else []


def detours(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """Free simple detours: the cheapest few by W that are different ways."""
    cell = space.scene.cell
    postures = [np.array(cell.park), np.array(cell.machine_home)]
    rng = np.random.default_rng(seed)
    candidates = [
        *over_postures(start, goal, postures),
        *drawn_back(start, goal, postures),
        *scattered(start, goal, space.low, space.high, _SCATTERED, rng),
    ]
    candidates = [np.clip(path, space.low, space.high) for path in candidates]
    free = space.paths_free(candidates)
    return _different([path for path, is_free in zip(candidates, free, strict=True) if is_free], space)


def retreat(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """Free ways that first draw the tool back: the cheapest few that are different."""
    return _different(retreating_paths(start, goal, space, np.random.default_rng(seed)), space)


def tree(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """A free path found by two trees, however long it takes."""
    path = connect(start, goal[None], space, seed)
    return [] if path is None else [path]


def short_tree(start: FloatArray, goal: FloatArray, space: FreeSpace, seed: int) -> list[FloatArray]:
    """The same while it is quick."""
    path = connect(start, goal[None], space, seed, _SHORT_TREE)
    return [] if path is None else [path]


def genetic(
    start: FloatArray,
    goal: FloatArray,
    space: FreeSpace,
    seed: int,
    settings: GeneticSettings,
    journal: Journal,
) -> list[FloatArray]:
    """The straight movement with what collides corrected by a population (eqs. 9, 10); by name only.

    Nothing found: the journal says how near the population came, and which pair blocks.
    """
    found = corrected(start, goal, space, settings, np.random.default_rng(seed))
    if found.pair >= 0 and not found.ways:
        pair = space.scene.collision.pairs[found.pair]
        journal.note(
            "genetic correction",
            f"{found.generations} generations; the nearest to free lacks {found.shortfall * 1e3:.1f} mm "
            f"between {pair.body_a} and {pair.body_b}",
        )
    return found.ways


# in the order in which a first way is looked for; name and search
SEARCHES: Searches = (
    ("direct", direct),
    ("tree", short_tree),
    ("detours", detours),
    ("retreat", retreat),
    ("tree", tree),
)
# that find other ways round with another seed
EXPLORERS: Searches = (("detours", detours), ("tree", short_tree))


def _different(ways: list[FloatArray], space: FreeSpace) -> list[FloatArray]:
    """The cheapest few ways by W that are not the same way round."""
    weights = space.scene.weights
    chosen: list[FloatArray] = []
    for path in sorted(ways, key=lambda path: path_cost(weights, path)):
        middle = path[len(path) // 2]
        if all(np.abs(middle - other[len(other) // 2]).max() > _DIFFERENT for other in chosen):
            chosen.append(path)
        if len(chosen) == _WAYS:
            break
    return chosen


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
