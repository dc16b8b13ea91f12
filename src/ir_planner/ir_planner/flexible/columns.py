"""Certified movements between the stations of a route, with their energy over duration.

A loaded transport is planned among parts at all other places, an empty hop among parts at all
places: what is proved among more bodies holds among fewer, so the movements serve every order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ir_description import Cell, PartPlaces, ProgramStep
from ir_description.cell import PartRoute
from ir_planner.cycle import Curve
from ir_planner.flexible.tending_cell import all_lying, held_from, with_parts_at
from ir_planner.program import (
    ACROSS,
    ENTER,
    LEAVE,
    HopPart,
    Ladder,
    Movements,
    PlacedStep,
    ProgramRequest,
    Route,
    Scenes,
    StageError,
    StopNode,
    TimeValues,
    cheapest_chain,
    nobody,
    station_nodes,
)
from ir_planner.request import Context
from ir_planner.scene import PlanningScene
from ir_planner.service import ServiceLine, exit_searches
from ir_planner.timing import Movement

Key = tuple[str, str, str, bool]
"""A kind of movement, from which station, to which, and whether a part is held."""

UnitKey = tuple[Key, int]
"""The same of one of the units of a cycle."""

RUNGS = (20, 17, 14, 11, 8, 5, 2, 0)  # of the ladder of time values: from time alone to least
_SLOWER = (1.15, 1.3, 1.5, 1.75, 2.0, 2.5, 3.0)  # times the slowest, where a wait costs more


@dataclass(frozen=True, eq=False)
class MovementColumn:
    """Certified movements between two places, fastest first, and the convex curve below them."""

    movements: tuple[Movement, ...]
    curve: Curve

    @staticmethod
    def of(movements: Sequence[Movement]) -> MovementColumn:
        """The column of movements."""
        known = sorted(movements, key=lambda each: each.trajectory.duration)
        points = [(each.trajectory.duration, each.energy.total) for each in known]
        return MovementColumn(tuple(known), Curve.below(points))

    def taking(self, seconds: float) -> Movement:
        """The cheapest certified movement that takes at most `seconds`: one of the column, or one
        that is slowed down to take so long.
        """
        fitting = [each for each in self.movements if each.trajectory.duration <= seconds + 1e-9]
        best = min(fitting or self.movements[:1], key=lambda each: each.energy.total)
        for one in reversed(fitting):
            factor = int(1e6 * seconds / one.trajectory.duration) / 1e6
            slower = one.stretched_by(factor) if factor > 1.0 else one
            if slower.energy.total < best.energy.total and slower.prove().certified:
                return slower
        return best


@dataclass(frozen=True, eq=False)
class TendedRoute:
    """A route in its cell. nodes: the configuration at each station; columns: all movements."""

    cell: Cell
    route: PartRoute
    scenes: Scenes
    nodes: Mapping[str, StopNode]
    choices: Mapping[str, list[StopNode]]
    columns: Mapping[Key, MovementColumn]

    @property
    def empty(self) -> PlanningScene:
        """With a part at every place and none in the gripper."""
        return self.scenes.of(all_lying(self.route))


def planned_columns(request: ProgramRequest, route: PartRoute, context: Context) -> TendedRoute:
    """The configurations of the cheapest way of a part along its route, and the movements between
    all stations. Raises StageError for a station that can't be reached.
    """
    full = with_parts_at(request.cell, range(1, len(route.visits)))
    settings = request.settings
    scenes = Scenes(full, request.power, settings.drives(full.robot))
    context = context.inside(scenes.of(all_lying(route)))
    improvement = settings.improvement_iterations
    choices = _choices(request, route, scenes, context)
    nodes = _configurations(request, route, scenes, context, choices)
    hops = _hops(route)
    steps: list[PlacedStep] = []
    layers = [[nodes[route.visits[0]]]]
    for start, end, places in hops:
        for name in (start, end):
            steps.append(PlacedStep(ProgramStep("STATION", name), places, places))
            layers.append([nodes[name]])
    over = Route(tuple(steps), scenes, tuple(range(len(steps))))
    parts = _keys_of_parts(hops)
    movements = Movements(over, layers, context, settings.searches)
    with context.journal.stage("curves") as notes:
        values = TimeValues(Ladder(movements, improvement), list(parts))
        for rung in RUNGS:
            values.seconds(rung)
        fronts = values.fronts()
        notes.append(f"{len(parts)} movements at {len(RUNGS)} values of a second")
    columns = {
        key: MovementColumn.of(slowed_down([point.movement for point in fronts[part]]))
        for part, key in parts.items()
    }
    return TendedRoute(request.cell, route, scenes, nodes, choices, columns)


def slowed_down(front: list[Movement]) -> list[Movement]:
    """The movements, and the slowest slowed down as long as its drives save by that."""
    slowest = front[-1]
    drives = slowest.energy.total - slowest.energy.base
    found = list(front)
    for factor in _SLOWER:
        slower = slowest.stretched_by(factor)
        now = slower.energy.total - slower.energy.base
        if now >= drives or not slower.prove().certified:
            break
        drives = now
        found.append(slower)
    return found


def _hops(route: PartRoute) -> list[tuple[str, str, PartPlaces]]:
    """Loaded transports, then empty hops from every place to every other."""
    visits = route.visits
    loaded = [(visits[a], visits[a + 1], held_from(route, a)) for a in range(len(visits) - 1)]
    lying = all_lying(route)
    empty = [(start, end, lying) for start in visits[1:] for end in visits[:-1] if start != end]
    return loaded + empty


def _keys_of_parts(hops: Sequence[tuple[str, str, PartPlaces]]) -> dict[HopPart, Key]:
    """The movements of all hops; those along service lines once for each station."""
    parts: dict[HopPart, Key] = {}
    seen = set[Key]()
    for k, (start, end, places) in enumerate(hops):
        hop = 2 * k + 1
        loaded = places.held != ""
        for part, key in (
            (HopPart(hop, LEAVE, 0, -1), (LEAVE, start, start, loaded)),
            (HopPart(hop, ACROSS, 0, 0), (ACROSS, start, end, loaded)),
            (HopPart(hop, ENTER, -1, 0), (ENTER, end, end, loaded)),
        ):
            if key not in seen:
                seen.add(key)
                parts[part] = key
    return parts


def _choices(
    request: ProgramRequest, route: PartRoute, scenes: Scenes, context: Context
) -> dict[str, list[StopNode]]:
    """Configurations at every station that can be entered and left, loaded and empty."""
    settings = request.settings
    exits = exit_searches(settings.withdrawal)
    empty = scenes.of(all_lying(route))
    near = request.start
    found = {}
    with context.journal.stage("configurations") as notes:
        for place, name in enumerate(route.visits):
            loaded = scenes.of(held_from(route, max(place - 1, 0)))
            arriving, leaving = (empty, loaded) if place == 0 else (loaded, empty)
            at = context.inside(arriving).at(name)
            nodes, status = station_nodes(at, leaving, near, exits, settings.interaction)
            if not status.ok:
                raise StageError(status)
            found[name] = nodes
            near = nodes[0].departure
        notes.append(" x ".join(str(len(nodes)) for nodes in found.values()))
    return found


def _configurations(
    request: ProgramRequest,
    route: PartRoute,
    scenes: Scenes,
    context: Context,
    choices: Mapping[str, list[StopNode]],
) -> dict[str, StopNode]:
    """The configuration at each station along the cheapest chain of a part through its route and
    back empty.
    """
    visits = route.visits
    lying = all_lying(route)
    steps = [PlacedStep(ProgramStep("STATION", visits[0]), lying, lying)]
    for a, name in enumerate(visits[1:]):
        places = held_from(route, a)
        steps.append(PlacedStep(ProgramStep("STATION", name), places, places))
    steps.append(PlacedStep(ProgramStep("STATION", visits[0]), lying, lying))
    layers = [
        [StopNode(ServiceLine(request.start[None]))],
        *(choices[name] for name in visits),
        choices[visits[0]],
    ]
    over = Route(tuple(steps), scenes, tuple(range(len(steps))))
    movements = Movements(over, layers, context, request.settings.searches)
    chain = cheapest_chain(movements, request.settings.improvement_iterations, nobody)
    return {
        name: choices[name][chosen] for name, chosen in zip(visits, chain.chosen[1:], strict=False)
    }


def activity_keys(visits: Sequence[str], activity: int) -> list[Key]:
    """The movements of an activity in order."""
    start = visits[activity]
    end = visits[activity + 1]
    return [
        (ENTER, start, start, False),
        (LEAVE, start, start, True),
        (ACROSS, start, end, True),
        (ENTER, end, end, True),
        (LEAVE, end, end, False),
    ]


def exact(movement: Movement, scene: PlanningScene, station: str) -> Movement:
    """The movement in the scene in which it is driven, to be proved there."""
    context = movement.context.inside(scene).at(station)
    return replace(movement, context=context)
