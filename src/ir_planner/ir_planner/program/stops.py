"""Nodes at a stop of a program: configurations that can be entered and left with what is held
then.
"""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from ir_description import Station
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import FreeSpace, too_near
from ir_planner.configurations import (
    INTERACTION,
    Configurations,
    InteractionSettings,
    configuration_log,
    free_configurations,
    no_configuration,
    searched_configurations,
)
from ir_planner.program.node import Node
from ir_planner.program.withdrawals import leaves_zone, withdrawn_lines
from ir_planner.request import Context
from ir_planner.scene import PlanningScene
from ir_planner.service import ExitSearch, ServiceLine, lines_free, service_lines

_MOST = 64  # configurations per station that take part: 8 branches with all turns of A1, A4 and A6


def posture_nodes(name: str, arriving: Context) -> tuple[list[Node], Status]:
    """The one configuration of a posture, or none with the pair that is too near."""
    scene = arriving.scene
    margin = arriving.safety_distance
    q = np.array(scene.cell.posture(name))
    space = FreeSpace.of(scene, margin, arriving.work)
    if not space.states_free(q[None])[0]:
        return [], Status(
            StatusCode.GOAL_IN_COLLISION, too_near(q, space, f"posture {name}", margin)
        )
    return [Node(ServiceLine(q[None]))], Status.success()


def station_nodes(
    arriving: Context,
    leaving: PlanningScene,
    near: FloatArray,
    searches: Mapping[str, ExitSearch],
    interaction: InteractionSettings = INTERACTION,
) -> tuple[list[Node], Status]:
    """Configurations at the context's station, cheapest from `near` (n,) first, with a free path in
    and out; or none and why.

    The path is the straight service line where it is free and ends outside the machine's zone, else
    a withdrawal; where neither leaves the zone, a free line within it. A station may ask for the
    withdrawal: then it is that or none.
    """
    scene = arriving.scene
    journal = arriving.journal
    name = arriving.station
    station = scene.station(name)
    found = _configurations(station, arriving, near, interaction)
    journal.rejected.update(found.rejected)
    if len(found.q) == 0:
        return [], no_configuration(station.pose, scene, found, f"station {name}")
    both = (arriving, arriving.inside(leaving))
    rejected: Counter[str] = Counter()
    lines = service_lines(found.q[:_MOST], arriving, rejected)
    for context in both:
        free = lines_free(lines, context, rejected)
        lines = [line for line, is_free in zip(lines, free, strict=True) if is_free]
    out = leaves_zone(lines, arriving)
    straight = [line for line, leaves in zip(lines, out, strict=True) if leaves]
    asked = station.search
    if straight and not asked.withdrawal:
        lines = straight
    else:
        withdrawn = withdrawn_lines(found.q[:_MOST], both, searches, rejected)
        lines = withdrawn if withdrawn or asked.withdrawal else lines
    journal.rejected.update(+rejected)
    if not lines:
        return [], _no_exit(station, len(found.q), len(straight), +rejected)
    return [Node(line) for line in lines], Status.success()


def _no_exit(
    station: Station, configurations: int, straight: int, rejected: Counter[str]
) -> Status:
    """The status of a station that no line and no withdrawal leaves; straight: lines that are free
    and that the station doesn't want.
    """
    reasons = ", ".join(f"{reason} ({count})" for reason, count in rejected.most_common(4))
    method = station.search.withdrawal
    if method:
        free = (
            f"; without `withdrawal: {method}` {straight} straight lines are free"
            if straight
            else ""
        )
        sentence = (
            f"the withdrawal {method} that it asks for leads out of none of {configurations} free "
        )
        sentence += f"configurations: {reasons}{free}"
    else:
        sentence = f"none of {configurations} free configurations has a free straight line out of "
        sentence += f"{station.approach_distance:g} m, nor a withdrawal: {reasons}"
    return Status(StatusCode.PLANNING_FAILED, f"station {station.name}: {sentence}")


def _configurations(
    station: Station, arriving: Context, near: FloatArray, settings: InteractionSettings
) -> Configurations:
    """Free configurations at a station, cheapest from `near` (n,) first, by the search that it asks
    for.
    """
    scene = arriving.scene
    journal = arriving.journal
    search = station.search
    threshold = arriving.thresholds()
    if search.configurations == "analytic":
        return free_configurations(station.pose, scene, threshold, near)
    with journal.stage("ccd") as notes:
        found = searched_configurations(
            station.pose,
            scene,
            threshold,
            near,
            search.starts,
            journal.seed,
            settings,
            journal.work,
        )
        notes.append(f"{found.reached} of {search.starts} starts reach {station.name}")
    journal.keep(configuration_log(station.name, found, scene))
    return found
