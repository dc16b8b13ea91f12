"""The cell of a route with several parts in flight, and the program of one cycle in it.

Every part of a route is like the one that the file names. What lies elsewhere is a copy of it, with
capsules, bodies and allowed contacts of its own names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ir_description import (
    Cell,
    CellSignal,
    Part,
    PartPlaces,
    PartRoute,
    ProgramStep,
    Signal,
    Station,
)
from ir_kernels import portable
from ir_msgs_py.status import StatusCode
from ir_planner.cycle import SteadyCycle, Wait
from ir_planner.errors import RequestError
from ir_planner.program import AUTO
from ir_values.arrays import FloatArray

_NO_WAIT = 1e-6  # s: rounding of the linear program


def route_of(cell: Cell) -> PartRoute:
    """The route of a cell. Raises RequestError where it has none."""
    if cell.route is None:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"cell {cell.name} has no route: say which stations a part visits, as route: "
            "{part: gear, visits: [infeed, mill, outfeed]}, and the process of its machines",
        )
    return cell.route


def copy_name(route: PartRoute, place: int) -> str:
    """Name of the part that lies at a place of a route when a cycle begins."""
    return route.part if place == 0 else f"{route.part}.{place}"


def with_parts_at(cell: Cell, places: Sequence[int]) -> Cell:
    """The cell with a part at the first place of its route, and a copy at each of `places`; it has
    no program.
    """
    route = route_of(cell)
    original = cell.part(route.part)
    copies = [_copy(original, place, route) for place in places]
    return replace(
        cell,
        parts=(*cell.parts, *copies),
        stations=tuple(_with_contacts(station, original, places) for station in cell.stations),
        program=(),
        route=None,
    )


def _copy(part: Part, place: int, route: PartRoute) -> Part:
    load = replace(
        part.load,
        name=copy_name(route, place),
        capsules=tuple(
            replace(capsule, name=f"{capsule.name}.{place}") for capsule in part.load.capsules
        ),
    )
    bodies = tuple(replace(body, name=f"{body.name}.{place}") for body in part.bodies)
    return replace(part, load=load, bodies=bodies, station=route.visits[place])


def _with_contacts(station: Station, part: Part, places: Sequence[int]) -> Station:
    """The station with the contacts of the part for its copies too."""
    own = {capsule.name for capsule in part.load.capsules} | {body.name for body in part.bodies}
    more = [
        replace(
            contact,
            body_a=_of_copy(contact.body_a, own, place),
            body_b=_of_copy(contact.body_b, own, place),
        )
        for place in places
        for contact in station.allowed_contacts
        if own & {contact.body_a, contact.body_b}
    ]
    return replace(station, allowed_contacts=(*station.allowed_contacts, *more))


def _of_copy(name: str, own: set[str], place: int) -> str:
    return f"{name}.{place}" if name in own else name


def all_lying(route: PartRoute) -> PartPlaces:
    """A part at every place of a route: what an empty hop may meet in any order."""
    places = enumerate(route.visits)
    return PartPlaces("", {copy_name(route, place): station for place, station in places})


def held_from(route: PartRoute, activity: int) -> PartPlaces:
    """The part of an activity is held, its two places are empty, all others have a part: what it
    may meet in any order.
    """
    lying = dict(all_lying(route).lying)
    lying[copy_name(route, activity)] = ""
    lying[copy_name(route, activity + 1)] = ""
    return PartPlaces(copy_name(route, activity), lying)


def front_name(station: str) -> str:
    """Name of the place in front of a station, where the robot waits."""
    return f"{station}.front"


def cycle_program(cell: Cell, cycle: SteadyCycle) -> tuple[ProgramStep, ...]:
    """One cycle as steps, from in front of the first station of the route until the robot is there
    again. It waits in front of stations, starts every machine when it has left it, and waits for
    the machine before it takes a part.
    """
    route = route_of(cell)
    names = machines_of(cell)
    last = len(route.visits) - 1
    lying = {place: copy_name(route, place) for place in (0, *occupied(cycle))}
    steps: list[ProgramStep] = []
    following = (*cycle.visits[1:], cycle.visits[0])
    for visit, after in zip(cycle.visits, following, strict=True):
        place = visit.activity
        part = lying.pop(place)
        lying[place + 1] = part
        here = route.visits[place + 1]
        done = (Signal(f"{names[place]}.done"),) if place > 0 else ()
        start = (Signal(f"{names[place + 1]}.start"),) if place + 1 < last else ()
        handling = route.handling
        steps += [
            ProgramStep("STATION", route.visits[place], dwell=handling, attach=part, wait_for=done),
            ProgramStep("STATION", here, dwell=handling, detach=part),
            ProgramStep("STATION", front_name(here), set_signals=start),
            *_pauses(visit.after),
        ]
        there = front_name(route.visits[after.activity])
        if there != front_name(here):
            steps.append(ProgramStep("STATION", there))
        steps += _pauses(after.before)
    return tuple(steps)


def _pauses(waits: Sequence[Wait]) -> list[ProgramStep]:
    return [
        ProgramStep("PAUSE", dwell=wait.seconds, power_mode=AUTO)
        for wait in waits
        if wait.seconds > _NO_WAIT
    ]


def machines_of(cell: Cell) -> tuple[str, ...]:
    """Names of the equipment at the stations of the route."""
    return tuple(cell.station(name).equipment for name in route_of(cell).visits)


def occupied(cycle: SteadyCycle) -> tuple[int, ...]:
    """Places at whose machine a part lies when the cycle begins: it is taken before one is
    brought.
    """
    first: dict[int, bool] = {}
    for visit in cycle.visits:
        first.setdefault(visit.activity, True)
        first.setdefault(visit.activity + 1, False)
    return tuple(sorted(place for place, taken in first.items() if taken and place > 0))


def program_cell(cell: Cell, cycle: SteadyCycle, fronts: Mapping[str, FloatArray]) -> Cell:
    """The cell with the parts that lie in it when a cycle begins, the places in front of its
    stations (poses (4, 4) of the tcp in the cell), signals of the machines, and the program of the
    cycle.
    """
    standing = with_parts_at(cell, occupied(cycle))
    names = machines_of(cell)
    visits = route_of(cell).visits
    stations = list(standing.stations)
    for name, pose in fronts.items():
        own = cell.station(name)
        inside = _within(cell.machine(own.equipment).pose, pose)
        stations.append(Station(front_name(name), own.equipment, pose, own.zone, inside))
    signals = list(standing.signals)
    for place in range(1, len(visits) - 1):
        start = f"{names[place]}.start"
        seconds = cell.machine(names[place]).process
        lies = place in occupied(cycle)
        signals.append(CellSignal(start))
        signals.append(CellSignal(f"{names[place]}.done", lies, start, seconds))
    return replace(
        standing,
        equipment=tuple(replace(machine, process=0.0) for machine in standing.equipment),
        stations=tuple(stations),
        signals=tuple(signals),
        program=cycle_program(cell, cycle),
    )


def _within(frame: FloatArray, pose: FloatArray) -> FloatArray:
    """A pose (4, 4) in a frame."""
    turned = frame[:3, :3].T
    inverse = np.eye(4)
    inverse[:3, :3] = turned
    inverse[:3, 3] = -portable.matmul(turned, frame[:3, 3])
    return portable.matmul(inverse, pose)
