"""Withdrawals for a program: at stations that lie in a zone which the straight service line does not leave.

One search per branch; configurations that differ by whole turns share its path, shifted by the turns. A path
must be free both with what is held on arriving and with what is held on leaving.
"""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_planner.checks import FreeSpace
from ir_planner.request import Context, Journal
from ir_planner.service import Exit, ExitSearch, ServiceLine, WorkArea, withdrawal

_WANTED = 2  # paths per branch: the second is for the scene in which the first collides
_SAME = 1e-6  # rad


def leaves_zone(lines: list[ServiceLine], context: Context) -> list[bool]:
    """Which service lines end outside the zone of the station's machine; all where its work is outside."""
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
    """Paths out of the zone from interaction configurations (K, n), free on arriving and on leaving."""
    found: list[ServiceLine] = []
    failed: list[FloatArray] = []
    robot = both[0].scene.cell.robot
    for q in interaction:
        twin = next((line for line in found if _turned(q, line.interaction)), None)
        if twin is not None:
            shifted = twin.points + (q - twin.interaction)
            if (shifted >= robot.position_min).all() and (shifted <= robot.position_max).all():
                found.append(ServiceLine(shifted, straight=False))
            continue
        if any(_turned(q, other) for other in failed):
            continue
        points = _exit_path(q, both, searches)
        if points is None:
            failed.append(q)
            rejected[f"no withdrawal from {both[0].station} found"] += 1
        else:
            found.append(ServiceLine(points, straight=False))
    return found


def _turned(a: FloatArray, b: FloatArray) -> bool:
    """Whether two configurations differ by whole turns only."""
    return bool(np.abs(np.sin(0.5 * (a - b))).max() < _SAME)


def _exit_path(
    q: FloatArray, both: tuple[Context, Context], searches: Mapping[str, ExitSearch]
) -> FloatArray | None:
    """The cheapest path (M, n) that is free in both scenes; searched in each of them."""
    for here, there in (both, both[::-1]):
        if here.work.exhausted:
            return None
        inside = FreeSpace.of(here.scene, here.safety_distance, here.work, here.station)
        if not inside.states_free(q[None])[0]:
            return None
        problem, other = Exit.of(q, here), Exit.of(q, there)
        inner = Journal(here.work, here.journal.seed)
        for path in withdrawal(problem, _WANTED, "", searches, inner).paths:
            points = path.points
            free = other.inside.edges_free(points[:-1], points[1:]).all() and other.is_out(points[-1:])[0]
            if free and other.contacts_end(points):
                return points
        if here.scene is there.scene:
            break
    return None
