"""Withdrawals for a program: at stations that lie in a zone which the straight service line does not leave.

One search per branch; configurations that differ by whole turns share its way, shifted by the turns. A way
must be free both with what is held on arriving and with what is held on leaving.
"""

from collections import Counter

import numpy as np
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions

from ir_description import Station
from ir_planner.checks import FreeSpace
from ir_planner.request import Journal
from ir_planner.scene import PlanningScene
from ir_planner.service import Exit, ServiceLine, WithdrawalSettings, WorkArea, ways_out

_WANTED = 2  # ways per branch: the second is for the scene in which the first collides
_SAME = 1e-6  # rad


def leaves_zone(
    lines: list[ServiceLine], station: Station, scene: PlanningScene, margin: float
) -> list[bool]:
    """Which service lines end outside the zone of the station's machine; all where its work is outside."""
    if not lines:
        return []
    area = WorkArea.of(scene, station)
    interaction = area.left(np.array([line.interaction for line in lines]), margin)
    outer = area.left(np.array([line.outside for line in lines]), margin)
    return [bool(out) for out in interaction | outer]


def withdrawn_lines(
    interaction: FloatArray,
    station: Station,
    scenes: tuple[PlanningScene, PlanningScene],
    options: PlanOptions,
    settings: WithdrawalSettings,
    journal: Journal,
    rejected: Counter[str],
) -> list[ServiceLine]:
    """Ways out of the zone from work configurations (K, n), free in both scenes (arriving, leaving)."""
    found: list[ServiceLine] = []
    failed: list[FloatArray] = []
    low, high = scenes[0].cell.robot.position_min, scenes[0].cell.robot.position_max
    for q in interaction:
        twin = next((line for line in found if _turned(q, line.interaction)), None)
        if twin is not None:
            shifted = twin.points + (q - twin.interaction)
            if (shifted >= low).all() and (shifted <= high).all():
                found.append(ServiceLine(shifted, straight=False))
            continue
        if any(_turned(q, other) for other in failed):
            continue
        points = _way(q, station, scenes, options, settings, journal)
        if points is None:
            failed.append(q)
            rejected[f"no withdrawal from {station.name} found"] += 1
        else:
            found.append(ServiceLine(points, straight=False))
    return found


def _turned(a: FloatArray, b: FloatArray) -> bool:
    """Whether two configurations differ by whole turns only."""
    return bool(np.abs(np.sin(0.5 * (a - b))).max() < _SAME)


def _way(
    q: FloatArray,
    station: Station,
    scenes: tuple[PlanningScene, PlanningScene],
    options: PlanOptions,
    settings: WithdrawalSettings,
    journal: Journal,
) -> FloatArray | None:
    """The cheapest way (M, n) that is free in both scenes; searched in each of them."""
    margin, work = options.safety_distance, journal.work
    for here, there in (scenes, scenes[::-1]):
        if work.exhausted:
            return None
        if not FreeSpace.of(here, margin, work, station.name).states_free(q[None])[0]:
            return None
        problem = Exit.of(q, here, station, margin, work)
        other = Exit.of(q, there, station, margin, work)
        inner = Journal(work, journal.seed)
        for way in ways_out(problem, settings, _WANTED, "", inner).ways:
            path = way.points
            free = other.inside.edges_free(path[:-1], path[1:]).all() and other.is_out(path[-1:])[0]
            if free and other.contacts_end(path):
                return path
        if here is there:
            break
    return None
