"""The ways to stand at a stop of a program: configurations that can be entered and left with what is held
then.
"""

from collections import Counter

import numpy as np
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import Status, StatusCode

from ir_planner.checks import FreeSpace, too_near
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.program.station_graph import Node
from ir_planner.program.withdrawals import leaves_zone, withdrawn_lines
from ir_planner.request import Journal
from ir_planner.scene import PlanningScene
from ir_planner.service import ServiceLine, WithdrawalSettings, lines_free, service_lines

_MOST = 24  # configurations per station that take part


def posture_nodes(
    name: str, arriving: PlanningScene, safety_distance: float, journal: Journal
) -> tuple[list[Node], Status]:
    """The one configuration of a posture, or none with the pair that is too near."""
    q = np.array(arriving.cell.posture(name))
    space = FreeSpace.of(arriving, safety_distance, journal.work)
    if not space.states_free(q[None])[0]:
        return [], Status(
            StatusCode.GOAL_IN_COLLISION, too_near(q, space, f"posture {name}", safety_distance)
        )
    return [Node(ServiceLine(q[None]))], Status.success()


def station_nodes(
    name: str,
    arriving: PlanningScene,
    leaving: PlanningScene,
    near: FloatArray,
    options: PlanOptions,
    settings: WithdrawalSettings,
    journal: Journal,
) -> tuple[list[Node], Status]:
    """Configurations at a station, cheapest from `near` (n,) first, with a free way in and out; or none and
    why.

    The way is the straight service line where it is free and ends outside the machine's zone, else a
    withdrawal; where neither leaves the zone, a free line within it.
    """
    safety_distance = options.safety_distance
    station = arriving.station(name)
    threshold = arriving.thresholds(safety_distance, name)
    found = free_configurations(station.pose, arriving, threshold, near)
    journal.rejected.update(found.rejected)
    if len(found.q) == 0:
        return [], no_configuration(station.pose, arriving, found, f"station {name}")
    rejected: Counter[str] = Counter()
    lines = service_lines(found.q[:_MOST], station, arriving, rejected)
    for scene in (arriving, leaving):
        free = lines_free(lines, station, scene, safety_distance, journal.work, rejected)
        lines = [line for line, is_free in zip(lines, free, strict=True) if is_free]
    out = leaves_zone(lines, station, arriving, safety_distance)
    if not any(out):
        scenes = (arriving, leaving)
        withdrawn = withdrawn_lines(found.q[:_MOST], station, scenes, options, settings, journal, rejected)
        lines = withdrawn or lines
    else:
        lines = [line for line, leaves in zip(lines, out, strict=True) if leaves]
    journal.rejected.update(+rejected)
    if not lines:
        reasons = ", ".join(f"{reason} ({count})" for reason, count in (+rejected).most_common(4))
        return [], Status(
            StatusCode.PLANNING_FAILED,
            f"station {name}: none of {len(found.q)} free configurations has a free way out of "
            f"{station.approach_distance:g} m, nor a withdrawal: {reasons}",
        )
    return [Node(line) for line in lines], Status.success()
