"""Searches for free ways: each takes a start and goals, and answers with paths of certified straight steps.

Where there are several goals (configurations of one pose), they come cheapest by W first; a way may lead to
any of them. A search that finds nothing says how near it came.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from ir_msgs_py.arrays import FloatArray

from ir_planner.checks import FreeSpace
from ir_planner.scene import path_cost
from ir_planner.search.correction import corrected
from ir_planner.search.detours import drawn_back, over_postures, scattered
from ir_planner.search.genetic_settings import GeneticSettings
from ir_planner.search.retract import retreating_paths
from ir_planner.search.tree import Meeting, connect

_SCATTERED = 160
_WAYS = 3  # different ways round of one search
_DIFFERENT = 0.15  # rad: ways whose vias are nearer are one way
_NEAREST = 3  # goals that the searches take which go to one goal at a time
_SHORT_TREE = 4000  # edges


@dataclass(frozen=True, eq=False)
class Found:
    """Free ways (M_k, n), cheapest by W first; `note`: how near a search came that found none."""

    ways: list[FloatArray]
    note: str = ""


@dataclass(frozen=True, eq=False)
class Ends:
    """start (n,), goals (G, n)."""

    start: FloatArray
    goals: FloatArray


Search = Callable[[Ends, FreeSpace, GeneticSettings, int], Found]


def direct(ends: Ends, space: FreeSpace, settings: GeneticSettings, seed: int) -> Found:
    """The straight movements that are free."""
    starts = np.repeat(ends.start[None], len(ends.goals), axis=0)
    free = np.flatnonzero(space.edges_free(starts, ends.goals))[:_WAYS]
    return Found([np.stack([ends.start, goal]) for goal in ends.goals[free]])


def detours(ends: Ends, space: FreeSpace, settings: GeneticSettings, seed: int) -> Found:
    """Simple detours: over the named postures, with the arm drawn back, over scattered configurations."""
    cell = space.scene.cell
    postures = [np.array(cell.park), np.array(cell.machine_home)]
    rng = np.random.default_rng(seed)
    candidates: list[FloatArray] = []
    for goal in ends.goals[:_NEAREST]:
        candidates += over_postures(ends.start, goal, postures)
        candidates += drawn_back(ends.start, goal, postures)
        candidates += scattered(ends.start, goal, space.low, space.high, _SCATTERED, rng)
    candidates = [np.clip(path, space.low, space.high) for path in candidates]
    free = space.paths_free(candidates)
    return Found(_different([path for path, is_free in zip(candidates, free, strict=True) if is_free], space))


def retreat(ends: Ends, space: FreeSpace, settings: GeneticSettings, seed: int) -> Found:
    """Ways that first draw the tool back."""
    rng = np.random.default_rng(seed)
    ways = [way for goal in ends.goals[:_NEAREST] for way in retreating_paths(ends.start, goal, space, rng)]
    return Found(_different(ways, space))


def tree(ends: Ends, space: FreeSpace, settings: GeneticSettings, seed: int) -> Found:
    """A way found by two trees, however long it takes."""
    return _grown(connect(ends.start, ends.goals, space, seed))


def short_tree(ends: Ends, space: FreeSpace, settings: GeneticSettings, seed: int) -> Found:
    """The same while it is quick."""
    return _grown(connect(ends.start, ends.goals, space, seed, _SHORT_TREE))


def genetic(ends: Ends, space: FreeSpace, settings: GeneticSettings, seed: int) -> Found:
    """The straight movement with what collides corrected by a population (eqs. 9, 10)."""
    rng = np.random.default_rng(seed)
    nearest: tuple[float, str] = (np.inf, "")
    for goal in ends.goals[:_NEAREST]:
        found = corrected(ends.start, goal, space, settings, rng)
        if found.ways:
            return Found(found.ways)
        if found.pair >= 0 and found.shortfall < nearest[0]:
            pair = space.scene.collision.pairs[found.pair]
            nearest = (
                found.shortfall,
                (
                    f"the nearest of {found.generations} generations lacks {found.shortfall * 1e3:.1f} mm "
                    f"between {pair.body_a} and {pair.body_b}"
                ),
            )
    return Found([], nearest[1])


def short_genetic(ends: Ends, space: FreeSpace, settings: GeneticSettings, seed: int) -> Found:
    """The same while it is quick: each stretch is tried once."""
    return genetic(ends, space, replace(settings, attempts=1), seed)


# in the order in which a first way is looked for
SEARCHES: tuple[tuple[str, Search], ...] = (
    ("direct", direct),
    ("tree", short_tree),
    ("detours", detours),
    ("retreat", retreat),
    ("tree", tree),
)
# that find other ways round with another seed
EXPLORERS: tuple[tuple[str, Search], ...] = (
    ("detours", detours),
    ("tree", short_tree),
    ("genetic", short_genetic),
)
BY_NAME_ONLY: tuple[tuple[str, Search], ...] = (("genetic", genetic),)


def _grown(found: Meeting) -> Found:
    if found.path is not None:
        return Found([found.path])
    return Found([], f"the trees came within {np.degrees(found.gap):.1f} deg of each other")


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
