"""Which ways a part may go through a cell, by the states that its stations take and give.

A station gives a part in another state than it takes it where a machine works on it; a buffer gives
what it takes. A route that names its visits is one way; otherwise the ways are all those on which
every station takes what the one before gives, from where the part lies to a station that gives
nothing on.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise

from ir_description.cell.equipment import Equipment, Part, Station
from ir_description.cell.program import VISITS, PartRoute
from ir_values.errors import InvalidValueError, UnknownNameError

WAYS_MAX = 8
"""Most ways of a part that are planned and compared."""


def check_route(
    route: PartRoute,
    parts: Collection[Part],
    machines: Collection[Equipment],
    stations: Collection[Station],
) -> None:
    """Refuse a route with unknown names, whose part doesn't lie at its begin, of which two stations
    are at the same equipment, on which one takes another state than the one before gives, or that
    visits what is neither a machine with a process nor a buffer, or leaves such a machine out.
    """
    known = {station.name: station for station in stations}
    for name in route.visits:
        if name not in known:
            raise UnknownNameError("station", name, known)
    own = {machine.name: machine for machine in machines}
    for station in stations:
        _check_states(station, own[station.equipment])
    visited = [known[name] for name in route.visits]
    _check_visited(visited, own)
    left_out = own.keys() - {station.equipment for station in visited[1:-1]}
    instead = {station.equipment for station in stations if station.takes}
    for machine in machines:
        given = _given_of(machine)
        if given and machine.name in left_out - instead:
            raise InvalidValueError(
                f"{machine.name} has {given}, but the route doesn't visit it between its first and "
                "its last station"
            )
    places = {part.name: part.station for part in parts}
    if route.part not in places:
        raise UnknownNameError("part", route.part, places)
    if places[route.part] != route.visits[0]:
        raise InvalidValueError(
            f"the route of {route.part} begins at {route.visits[0]}, but it lies at "
            f"{places[route.part] or 'no station'}"
        )


def _given_of(machine: Equipment) -> str:
    """What only a machine between the ends of a route has: a process or room; "" for neither."""
    if machine.process > 0.0:
        return f"a process of {machine.process:g} s"
    return f"room for {machine.places} parts" if machine.places > 1 else ""


def _check_visited(visited: Sequence[Station], machines: Mapping[str, Equipment]) -> None:
    names = [station.equipment for station in visited]
    for name in names:
        if names.count(name) > 1:
            raise InvalidValueError(
                f"the route visits {name} {names.count(name)} times: a machine is visited once"
            )
    for station in visited[1:-1]:
        if machines[station.equipment].process <= 0.0 and not _is_buffer(station):
            raise InvalidValueError(
                f"the route visits {station.equipment}, which has no process: give its time, as "
                "process: {seconds: 30}, or make it a buffer: a station that takes and gives the "
                "same state of a part"
            )
    state = visited[0].gives
    for before, station in pairwise(visited):
        if station.takes and state not in station.takes:
            raise InvalidValueError(
                f"{station.name} takes {' or '.join(station.takes)}, but {before.name} before it "
                f"gives {state or 'no state'}"
            )
        state = station.gives


def _check_states(station: Station, machine: Equipment) -> None:
    """Refuse a machine whose work changes nothing, and a change without work."""
    if not station.takes or not station.gives:
        return
    if machine.process > 0.0 and station.gives in station.takes:
        raise InvalidValueError(
            f"{station.name} gives {station.gives}, which it takes too, but {machine.name} works "
            "on the part: let it give another state"
        )
    if machine.process <= 0.0 and not _is_buffer(station):
        raise InvalidValueError(
            f"{station.name} takes {' or '.join(station.takes)} and gives {station.gives}, but "
            f"{machine.name} has no process: give its time, as process: {{seconds: 30}}"
        )


def _is_buffer(station: Station) -> bool:
    return station.takes == (station.gives,)


def part_routes(
    part: str, handling: float, parts: Collection[Part], stations: Sequence[Station]
) -> tuple[PartRoute, ...]:
    """All ways of a part by its states, those with the fewest visits first. Raises
    InvalidValueError where there is none, or more than WAYS_MAX.
    """
    lying = {each.name: each.station for each in parts}
    if part not in lying:
        raise UnknownNameError("part", part, lying)
    first = next((each for each in stations if each.name == lying[part]), None)
    if first is None or not first.gives or first.takes:
        raise InvalidValueError(
            f"the route of {part} has no visits: they follow from the states of the part, "
            f"but the station where it lies ({lying[part] or 'none'}) doesn't give one "
            "without taking any: write which states every station takes and gives, or the visits"
        )
    found: list[PartRoute] = []
    for way in _ways((first,), stations):
        visits = tuple(station.name for station in way)
        found.append(PartRoute(part, visits, handling, by_states=True))
        if len(found) > WAYS_MAX:
            raise InvalidValueError(
                f"{part} has more than {WAYS_MAX} ways through the cell by the states that "
                "its stations take and give: at most so many are compared"
            )
    if not found:
        raise InvalidValueError(
            f"{part} has no way through the cell: from {first.name} no stations that take "
            f"what the one before gives lead in {VISITS[0]} to {VISITS[1]} visits to one that "
            "takes a state and gives none"
        )
    return tuple(sorted(found, key=lambda each: len(each.visits)))


def _ways(way: tuple[Station, ...], stations: Sequence[Station]) -> Iterator[tuple[Station, ...]]:
    if len(way) == VISITS[1]:
        return
    taken = {station.equipment for station in way}
    for station in stations:
        if way[-1].gives not in station.takes or station.equipment in taken:
            continue
        if station.gives:
            yield from _ways((*way, station), stations)
        elif len(way) + 1 >= VISITS[0]:
            yield (*way, station)
