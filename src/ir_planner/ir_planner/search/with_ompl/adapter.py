"""A planner of OMPL behind the port of a search."""

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.tree import connect
from ir_planner.search.variety import NEAREST_GOALS
from ir_planner.search.with_ompl.host import asked, check_installed
from ir_planner.search.with_ompl.problem import Parameters, Problem

_SHARE = (
    0.75  # of the work that is left goes into OMPL's checks: its path is certified, and improved
)
_REPAIR = 4000  # edges of a tree around a blocked step


def found_by(
    name: str,
    parameters: Parameters,
    edges: int,
    ends: Ends,
    space: FreeSpace,
    seed: int,
    work: Work,
) -> Found:
    """What OMPL's planner finds with `edges` checks at most; every step of its path is certified
    here: some of them smooth their paths without asking.

    Raises RequestError where OMPL isn't installed or can't be loaded, CancelledError when asked to
    stop.
    """
    check_installed(name)
    checks = min(edges, int(_SHARE * work.left))
    if checks == 0 or work.exhausted:
        return Found([], "no work was left")
    goals = ends.goals[:NEAREST_GOALS]
    seconds = work.deadline - work.clock()
    problem = Problem(
        space.scene, space.threshold, ends.start, goals, parameters, seed, checks, seconds
    )
    outcome = asked(problem, work)
    if outcome.unusable:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"planner_id {name!r}: OMPL is installed but can't be loaded: {outcome.error}",
        )
    if outcome.path is None:
        return Found([], outcome.error or f"OMPL found no path in {outcome.edges} checks")
    path = repaired(_between(outcome.path, ends), space, seed)
    return Found(
        [path] if path is not None else [], "OMPL's path is blocked and could not be repaired"
    )


def _between(path: FloatArray, ends: Ends) -> FloatArray:
    """The path (M, n) with the ends that were asked for, bit by bit, and without steps that don't
    move.
    """
    path = path.copy()
    path[0] = ends.start
    path[-1] = ends.goals[np.abs(ends.goals - path[-1]).max(axis=1).argmin()]
    moves = np.abs(np.diff(path, axis=0)).max(axis=1) > 0.0
    return np.asarray(path[np.concatenate([[True], moves])])


def repaired(path: FloatArray, space: FreeSpace, seed: int) -> FloatArray | None:
    """The path (M, n) with small trees in place of its steps that are not certified free; None
    where a tree finds nothing. Configurations that are not free are left out first.
    """
    ends_too = space.states_free(path)
    ends_too[[0, -1]] = True
    path = path[ends_too]
    free = space.edges_free(path[:-1].copy(), path[1:].copy())
    pieces = [path[:1]]
    for k, step_is_free in enumerate(free):
        if step_is_free:
            pieces.append(path[k + 1 : k + 2])
            continue
        detour = connect(path[k], path[None, k + 1], space, seed, _REPAIR).path
        if detour is None:
            return None
        pieces.append(detour[1:])
    return np.concatenate(pieces)
