"""Stops of a program: configurations that can be entered and left, with service lines."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ir_description import Station
from ir_kernels import portable
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cartesian import PathRefusedError, choices_along
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
from ir_planner.errors import RequestError
from ir_planner.request import Context, Journal
from ir_planner.scene import PlanningScene, path_cost
from ir_planner.search import EXIT, first_different
from ir_planner.service import (
    Exit,
    ExitPath,
    ExitSearch,
    ServiceLine,
    WorkArea,
    lines_free,
    service_lines,
    withdrawal,
)
from ir_planner.timing import Movement
from ir_values.arrays import FloatArray

# A configuration at a stop with its service line: what the layers of the station graph consist
# of.


@dataclass(frozen=True, eq=False)
class StopNode:
    """Where the arm works at a stop, and where nothing else may be near it (the outer end of its
    line).

    driven: the movement along a stop that is a path. Its line leads from the path's beginning to
    its end, and the arm leaves from there.
    """

    line: ServiceLine
    driven: Movement | None = None

    @property
    def interaction(self) -> FloatArray:
        """At the stop, at the end of a path (n,)."""
        return self.line.interaction

    @property
    def arrival(self) -> FloatArray:
        """Where a regional movement to the stop ends (n,)."""
        return self.line.outside

    @property
    def departure(self) -> FloatArray:
        """Where a regional movement from the stop starts (n,)."""
        return self.line.outside if self.driven is None else self.line.interaction

    @property
    def enters(self) -> bool:
        """Whether the arm moves from its arrival to where it works."""
        return len(self.line.points) > 1

    @property
    def leaves(self) -> bool:
        """Whether it moves from there to its departure."""
        return self.enters and self.driven is None


# Withdrawals for a program: at stations that lie in a zone which the straight service line does
# not leave.
#
# Some searches per branch; configurations that differ by whole turns share their paths, shifted
# by the turns. A path must be free both with what is held on arriving and with what is held on
# leaving.

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
    lines: list[ServiceLine] = []
    searched: list[tuple[FloatArray, list[ExitPath]]] = []
    robot = both[0].scene.cell.robot
    for q in interaction:
        paths_there = next(
            (paths for q_before, paths in searched if _is_turned_only(q, q_before)), None
        )
        paths = _exit_paths(q, both, searches) if paths_there is None else paths_there
        if paths_there is None:
            searched.append((q, paths))
            if not paths:
                rejected[f"no withdrawal from {both[0].station} found"] += 1
        for path in paths:
            shifted = path.points + (q - path.points[0])
            if (shifted >= robot.position_min).all() and (shifted <= robot.position_max).all():
                lines.append(ServiceLine(shifted, straight=False, exit=path))
    return lines


def _is_turned_only(a: FloatArray, b: FloatArray) -> bool:
    """Whether two configurations differ by whole turns only."""
    return bool(np.abs(portable.sin(0.5 * (a - b))).max() < _SAME)


def _exit_paths(
    q: FloatArray, both: tuple[Context, Context], searches: Mapping[str, ExitSearch]
) -> list[ExitPath]:
    """Different paths (M, n) that are free in both scenes, of several searches in each of them;
    which serves best is decided with the chain.
    """
    exits: list[ExitPath] = []
    method = both[0].scene.station(both[0].station).search.withdrawal
    more = min(both[0].work.improvement // _FOR_ANOTHER, _MOST)
    for here, there in (both, both[::-1]):
        inside = FreeSpace.of(here.scene, here.safety_distance, here.work, here.station)
        if here.work.exhausted or not inside.states_free(q[None])[0]:
            return []
        problem = Exit.of(q, here)
        exit_there = Exit.of(q, there)
        for seed in dict.fromkeys(
            (*range(_SEARCHES), here.journal.seed, *range(_SEARCHES, _SEARCHES + more))
        ):
            paths: list[ExitPath] = []
            inner = Journal(here.work, seed)
            for path in withdrawal(problem, _WANTED, method, searches, inner).paths:
                points = path.points
                free = exit_there.inside.edges_free(points[:-1], points[1:]).all()
                if free and exit_there.is_out(points[-1:])[0] and exit_there.contacts_end(points):
                    paths.append(path)
            exits += sorted(paths, key=lambda path: path_cost(here.scene.weights, path.points))
            if not exits:
                break
        if exits or here.scene is there.scene:
            break
    return first_different(exits, _KEPT + more, EXIT, lambda path: path.points[-1])


# Nodes at a stop of a program: configurations that can be entered and left with what is held
# then.

# configurations per station that take part: 8 branches with all turns of A1, A4 and A6
_MOST_STOPS = 64


def posture_nodes(name: str, arriving: Context) -> tuple[list[StopNode], Status]:
    """The one configuration of a posture, or none with the pair that is too near."""
    scene = arriving.scene
    margin = arriving.safety_distance
    q = np.array(scene.cell.posture(name))
    space = FreeSpace.of(scene, margin, arriving.work)
    if not space.states_free(q[None])[0]:
        return [], Status(
            StatusCode.GOAL_IN_COLLISION, too_near(q, space, f"posture {name}", margin)
        )
    return [StopNode(ServiceLine(q[None]))], Status.success()


def station_nodes(
    arriving: Context,
    leaving: PlanningScene,
    near: FloatArray,
    searches: Mapping[str, ExitSearch],
    interaction: InteractionSettings = INTERACTION,
) -> tuple[list[StopNode], Status]:
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
    configurations = _configurations(station, arriving, near, interaction)
    journal.rejected.update(configurations.rejected)
    if len(configurations.q) == 0:
        return [], no_configuration(station.pose, scene, configurations, f"station {name}")
    both = (arriving, arriving.inside(leaving))
    rejected: Counter[str] = Counter()
    lines = service_lines(configurations.q[:_MOST_STOPS], arriving, rejected)
    for context in both:
        free = lines_free(lines, context, rejected)
        lines = [line for line, is_free in zip(lines, free, strict=True) if is_free]
    out = leaves_zone(lines, arriving)
    straight = [line for line, leaves in zip(lines, out, strict=True) if leaves]
    search = station.search
    if straight and not search.withdrawal:
        lines = straight
    else:
        withdrawn = withdrawn_lines(configurations.q[:_MOST_STOPS], both, searches, rejected)
        lines = withdrawn if withdrawn or search.withdrawal else lines
    journal.rejected.update(+rejected)
    if not lines:
        return [], _no_exit(station, len(configurations.q), len(straight), +rejected)
    return [StopNode(line) for line in lines], Status.success()


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
        solutions = searched_configurations(
            station.pose,
            scene,
            threshold,
            near,
            search.starts,
            journal.seed,
            settings,
            journal.work,
        )
        notes.append(f"{solutions.reached} of {search.starts} starts reach {station.name}")
    journal.keep(configuration_log(station.name, solutions, scene))
    return solutions


# Nodes at a stop that is a path of the tool: movements along it in different configurations.

# movements along a path that take part, as many as configurations of a station
_MOST_PATH_STOPS = 64


def path_nodes(arriving: Context, leaving: PlanningScene) -> tuple[list[StopNode], Status]:
    """Certified movements along the context's path, each from and to where nothing may be touched;
    or none and why. Raises RequestError where the path is refused.
    """
    name = arriving.station
    path = arriving.scene.cell.path(name)
    after = FreeSpace.of(leaving, arriving.safety_distance, arriving.work)
    try:
        paths = choices_along(path, arriving, after, _MOST_PATH_STOPS)
    except PathRefusedError as error:
        return [], _along(name, error.status)
    except RequestError as error:  # a path that draws nothing
        raise RequestError(error.code, f"path {name}: {error}") from error
    return [
        StopNode(ServiceLine(driven.points[::-1], straight=False), driven.movement)
        for driven in paths
    ], Status.success()


def _along(name: str, status: Status) -> Status:
    return Status(StatusCode(status.code), f"along path {name}: {status.message}")
