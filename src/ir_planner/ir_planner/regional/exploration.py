"""Which searches look for the first free path, and which for paths of other homotopy classes.

A request that names a planner gets that search alone. The default portfolio asks the cheap ones
first: each with little work, and then those that can do more. Which class is the best is decided by
guesses, before the first refinement and whatever the seed; searches of other seeds only add to
them.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from ir_msgs_py.report import FIRST_PATH
from ir_planner.checks import FreeSpace
from ir_planner.optimize import QUICK, THOROUGH, Portfolio, Refinement
from ir_planner.request import Context
from ir_planner.search import (
    EXPLORERS,
    FIRST_SEARCHES,
    SEARCHES,
    Ends,
    Search,
    correction_log,
    guesses,
    keeps_upright,
    quick,
    role_of,
)
from ir_values.arrays import FloatArray

Searches = Mapping[str, Search]
Path = tuple[str, FloatArray]  # the search that found it, and its waypoints (M, n)
GUESS = "guess"  # the method of movements that a guess became
_GOALS = 6  # configurations of a pose that guesses lead to
_FEWEST_GUESSES = 8  # to each of them
# Where a straight segment is free, another class is rarely cheaper: fewer guesses, and only those
# descend further that cost less than so many times the straight one at first sight.
_FEW_GUESSES = 8
_WORTH_FOLLOWING = 1.3
# Paths beside the best that are refined like it where a duration is requested: their order in
# joules is less certain.
_RIVALS = 2
# Coarse solutions that are optimised per turn: the second is best in one of four tasks.
_REFINED = 2


def first_paths(
    ends: Ends, space: FreeSpace, context: Context, searches: Searches, *, briefly: bool
) -> list[Path]:
    """The first free paths, by the first search that finds any; none where all failed. briefly: by
    searches with little work, of the default portfolio only.
    """
    journal = context.journal
    for name, search in _attempts(context, searches, briefly):
        with journal.stage(name) as notes:
            notes.extend(filter(None, [SEARCHES.origin(name)]))
            found = search.find(ends, space, context.options.seed)
            if found.paths:
                notes.append(f"{FIRST_PATH}: {len(found.paths)} free, {len(found.paths[0])} points")
            else:
                notes.append("nothing free" + (f", {found.note}" if found.note else ""))
        if found.correction is not None:
            journal.keep(correction_log(found.correction, found.paths[0], ends.start, space))
        if found.paths:
            return [(name, path) for path in found.paths]
        # not before the first: what is free at once is found in any time
        if journal.work.exhausted:
            break
    return []


def heeds_the_tilt(search: Search, context: Context) -> bool:
    """Whether the paths of a search keep the tilt that is asked for; true where none is."""
    return context.cone is None or keeps_upright(search)


def _attempts(context: Context, searches: Searches, briefly: bool) -> Iterator[tuple[str, Search]]:
    """The searches for a first path with their names, in turn."""
    planner_id = context.options.planner_id
    if planner_id:
        if not briefly:
            yield planner_id, searches[planner_id]
        return
    for name in FIRST_SEARCHES:
        if not heeds_the_tilt(searches[name], context):
            continue
        if briefly:
            yield name, quick(searches[name])
        elif quick(searches[name]) != searches[name]:
            yield name, searches[name]


def improve(
    ends: Ends, paths: list[Path], portfolio: Portfolio, context: Context, searches: Searches
) -> None:
    """Optimise the first paths and guesses of many homotopy classes, refine the best of them; then
    look for other classes by chance and optimise the best of all, turn by turn, until the work is
    spent.
    """
    work = context.work
    journal = context.journal
    until = work.iterations + work.improvement

    def more() -> bool:
        return work.iterations < until and not work.exhausted

    with journal.stage("refine") as notes:
        notes.append(
            _refined_first(
                ends, paths, portfolio, guided=context.options.planner_id == "", more=more
            )
        )
    explorers = [
        name
        for name in EXPLORERS
        if context.options.planner_id in ("", name) and heeds_the_tilt(searches[name], context)
    ]
    turn = 0
    with journal.stage("improve") as notes:
        new = Counter[str]()
        certified = 0
        while more():
            before = work.iterations
            for name in explorers:
                later = turn == 0 and len(explorers) > 1 and role_of(name).costly
                if more() and not later:
                    seed = _seed(context.options.seed, turn, name)
                    found = quick(searches[name]).find(ends, portfolio.space, seed)
                    new[name] += portfolio.add(name, found.paths)
            certified += portfolio.refine_best(_REFINED) if more() else 0
            if more():
                certified += portfolio.deepen()
            turn += 1
            if work.iterations == before:
                break  # nothing left to do
        others = ", ".join(f"{count} by {name}" for name, count in new.items() if count)
        notes.append(f"{turn} turns, new paths: {others or 'none'}; {certified} certified")


def _refined_first(
    ends: Ends, paths: list[Path], portfolio: Portfolio, *, guided: bool, more: Callable[[], bool]
) -> str:
    """Optimise the first paths and guesses, and refine the best; a note what came of it.

    guided: guesses too, while there is more work. They alone lead to movements as good as with a
    first path that isn't straight. So that path is set aside, unless a duration is requested, until
    it turns out that none of them is certified.
    """
    requested = portfolio.context.options.duration > 0.0
    straight = any(len(path) == 2 for _, path in paths)
    guided = guided and more()
    method = paths[0][0]
    free = [path for _, path in paths]
    aside = guided and not (straight or requested)
    if not aside:
        portfolio.add(method, free)
    if not guided:
        return f"{portfolio.refine_best(1, QUICK)} certified"
    minima = _guessed(ends, portfolio, straight)
    if requested and not straight:
        minima += _fast_ones(ends, paths, portfolio)
    certified = portfolio.refine_best(1, THOROUGH)
    if aside and not certified:
        portfolio.add(method, free)
        certified = portfolio.refine_best(_REFINED, THOROUGH)
    if requested:
        certified += portfolio.refine_best(_RIVALS, THOROUGH)
    return f"{minima} local minima from guesses; {certified} certified"


def _guessed(ends: Ends, portfolio: Portfolio, straight: bool) -> int:
    """Descend from guesses to the nearest goals, which share them; how many new local minima there
    are. straight: a straight segment is free.
    """
    space = portfolio.space
    park = np.array(space.scene.cell.park)
    nearest = ends.goals[:_GOALS]
    paths = [
        space.kept_upright(guesses(ends.start, goal, park, space.low, space.high))
        for goal in nearest
    ]
    if straight:
        share = max(_FEW_GUESSES // len(nearest), 1)
        few = [path for of_goal in paths for path in of_goal[:share]]
        return portfolio.descend(GUESS, few, _WORTH_FOLLOWING)
    share = max(len(paths[0]) // len(nearest), _FEWEST_GUESSES)
    return portfolio.descend(GUESS, [path for of_goal in paths for path in of_goal[:share]])


def _fast_ones(ends: Ends, paths: list[Path], portfolio: Portfolio) -> int:
    """Local minima that the fastest movements come from: a shorter request is met by one of them,
    so a longer one has it among its candidates too. How many are new.
    """
    fast = Portfolio(portfolio.space, Refinement(portfolio.context.asking("time")))
    fast.add(paths[0][0], [path for _, path in paths])
    _guessed(ends, fast, straight=False)
    return portfolio.adopt(fast)


def _seed(seed: int, turn: int, name: str) -> int:
    """Another seed for every search of a request."""
    words = [seed % 2**63, turn, *name.encode()]
    return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0]) >> 1
