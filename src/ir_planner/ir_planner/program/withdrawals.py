"""Withdrawals for a program: at stations that lie in a zone which the straight service line does
not leave.

Some searches per branch; configurations that differ by whole turns share their paths, shifted by
the turns. A path must be free both with what is held on arriving and with what is held on leaving.
"""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_planner.checks import FreeSpace
from ir_planner.request import Context, Journal
from ir_planner.scene import path_cost
from ir_planner.search import EXIT, first_different
from ir_planner.service import Exit, ExitPath, ExitSearch, ServiceLine, WorkArea, withdrawal

_WANTED = 2  # paths per search: the second is for the scene in which the first collides
# per branch, whatever the seed, which adds to them: chance decided up to 2 % of a program's J
_SEARCHES = 3
# max_iterations that buy another search, and another path; at most
_FOR_ANOTHER = 16_000
_MOST = 16
_KEPT = 6  # paths per branch: each is a configuration of its own for the chain
_SAME = 1e-6  # rad


def leaves_zone(lines: list[ServiceLine], context: Context) -> list[bool]:
    """Which service lines end outside the zone of the station's machine; all where its work is
    outside.
    """
    if not lines:
        return []
    area = WorkArea.of(context.scene, context.scene.station(context.station))
    margin = context.safety_distance
    interaction = area.left(np.array([line.interaction for line in lines]), margin)
    outer = area.left(np.array([line.outside for line in lines]), margin)
    return [bool(out) for out in interaction | outer]


def withdrawn_lines(
    interaction: FloatArray,
    both: tuple[Context, Context],
    searches: Mapping[str, ExitSearch],
    rejected: Counter[str],
) -> list[ServiceLine]:
    """Paths out of the zone from interaction configurations (K, n), free on arriving and on
    leaving.
    """
    found: list[ServiceLine] = []
    searched: list[tuple[FloatArray, list[ExitPath]]] = []
    robot = both[0].scene.cell.robot
    for q in interaction:
        known = next((paths for other, paths in searched if _turned(q, other)), None)
        paths = _exit_paths(q, both, searches) if known is None else known
        if known is None:
            searched.append((q, paths))
            if not paths:
                rejected[f"no withdrawal from {both[0].station} found"] += 1
        for path in paths:
            shifted = path.points + (q - path.points[0])
            if (shifted >= robot.position_min).all() and (shifted <= robot.position_max).all():
                found.append(ServiceLine(shifted, straight=False, exit=path))
    return found


def _turned(a: FloatArray, b: FloatArray) -> bool:
    """Whether two configurations differ by whole turns only."""
    return bool(np.abs(portable.sin(0.5 * (a - b))).max() < _SAME)


def _exit_paths(
    q: FloatArray, both: tuple[Context, Context], searches: Mapping[str, ExitSearch]
) -> list[ExitPath]:
    """Different paths (M, n) that are free in both scenes, of several searches in each of them;
    which serves best is decided with the chain.
    """
    found: list[ExitPath] = []
    method = both[0].scene.station(both[0].station).search.withdrawal
    more = min(both[0].work.improvement // _FOR_ANOTHER, _MOST)
    for here, there in (both, both[::-1]):
        inside = FreeSpace.of(here.scene, here.safety_distance, here.work, here.station)
        if here.work.exhausted or not inside.states_free(q[None])[0]:
            return []
        problem = Exit.of(q, here)
        other = Exit.of(q, there)
        for seed in dict.fromkeys(
            (*range(_SEARCHES), here.journal.seed, *range(_SEARCHES, _SEARCHES + more))
        ):
            paths: list[ExitPath] = []
            inner = Journal(here.work, seed)
            for path in withdrawal(problem, _WANTED, method, searches, inner).paths:
                points = path.points
                free = other.inside.edges_free(points[:-1], points[1:]).all()
                if free and other.is_out(points[-1:])[0] and other.contacts_end(points):
                    paths.append(path)
            found += sorted(paths, key=lambda path: path_cost(here.scene.weights, path.points))
            if not found:
                break
        if found or here.scene is there.scene:
            break
    return first_different(found, _KEPT + more, EXIT, lambda path: path.points[-1])
