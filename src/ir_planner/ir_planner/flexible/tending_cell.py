"""The cell of a route with several parts in flight, and the steps of one transport in it.

Every part of a route is like the one that the file names. What lies elsewhere is a copy of it, with
capsules, bodies and allowed contacts of its own names.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ir_description import Cell, PartPlaces, ProgramStep, Station
from ir_description.cell import CellSignal, Part, PartRoute
from ir_kernels import portable
from ir_msgs_py.plc import Signal
from ir_msgs_py.status import StatusCode
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


def with_parts_at(cell: Cell, places: Sequence[int]) -> Cell:
    """The cell with a part at the first place of its route, and a copy at each of `places`; it has
    no program.
    """
    visits = route_of(cell).visits
    return with_copies(cell, {place: visits[place] for place in places})


def with_copies(cell: Cell, stations: Mapping[int, str]) -> Cell:
    """The cell with a part at the first place of its route, and copies by their numbers, each at a
    station ("": it isn't there yet); it has no program.
    """
    route = route_of(cell)
    original = cell.part(route.part)
    copies = [_copy(original, number, station, route) for number, station in stations.items()]
    return replace(
        cell,
        parts=(*cell.parts, *copies),
        stations=tuple(_with_contacts(each, original, stations) for each in cell.stations),
        program=(),
    )


def without_cycle(cell: Cell) -> Cell:
    """The cell of a route without what an earlier cycle has added: copies of the part, their
    contacts, and places to wait at.
    """
    route = route_of(cell)
    copies = {part.name for part in cell.parts if route.is_copy(part.name)}
    gone = {
        *(capsule.name for name in copies for capsule in cell.part(name).load.capsules),
        *(body.name for name in copies for body in cell.part(name).bodies),
    }
    fronts = {front_name(station) for station in route.visits}
    return replace(
        cell,
        parts=tuple(part for part in cell.parts if part.name not in copies),
        stations=tuple(
            replace(
                station,
                allowed_contacts=tuple(
                    contact
                    for contact in station.allowed_contacts
                    if not gone & {contact.body_a, contact.body_b}
                ),
            )
            for station in cell.stations
            if station.name not in fronts
        ),
        program=(),
    )


def _copy(part: Part, number: int, station: str, route: PartRoute) -> Part:
    load = replace(
        part.load,
        name=route.copy_name(number),
        capsules=tuple(
            replace(capsule, name=f"{capsule.name}.{number}") for capsule in part.load.capsules
        ),
    )
    bodies = tuple(replace(body, name=f"{body.name}.{number}") for body in part.bodies)
    return replace(part, load=load, bodies=bodies, station=station)


def _with_contacts(station: Station, part: Part, places: Iterable[int]) -> Station:
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
    return PartPlaces("", {route.copy_name(place): station for place, station in places})


def held_from(route: PartRoute, activity: int) -> PartPlaces:
    """The part of an activity is held, its two places are empty, all others have a part: what it
    may meet in any order.
    """
    lying = dict(all_lying(route).lying)
    lying[route.copy_name(activity)] = ""
    lying[route.copy_name(activity + 1)] = ""
    return PartPlaces(route.copy_name(activity), lying)


def front_name(station: str) -> str:
    """Name of the place in front of a station, where the robot waits."""
    return f"{station}.front"


def transport(
    cell: Cell, place: int, part: str, *, taken_from: str, brought_to: str
) -> tuple[ProgramStep, ...]:
    """The part at a place of the route is taken and brought to the next one; the robot ends in
    front of it. taken_from: the slot of the machine whose work it waits for, brought_to: the one
    that it starts; "": no machine works there.
    """
    route = route_of(cell)
    here = route.visits[place + 1]
    wait = (Signal(done_of(taken_from)),) if taken_from else ()
    taken = (Signal(start_of(taken_from), False),) if taken_from else ()
    begun = (Signal(start_of(brought_to)),) if brought_to else ()
    time = route.handling
    return (
        ProgramStep("STATION", route.visits[place], time, part, wait_for=wait, set_signals=taken),
        ProgramStep("STATION", here, dwell=time, detach=part),
        ProgramStep("STATION", front_name(here), set_signals=begun),
    )


def pause_steps(waits: Iterable[tuple[float, str]]) -> list[ProgramStep]:
    """Pauses of some seconds, each with the signal that it is for."""
    return [
        ProgramStep("PAUSE", dwell=seconds, power_mode=AUTO, since=since)
        for seconds, since in waits
        if seconds > _NO_WAIT
    ]


def slot_name(machine: str, number: int, most: int) -> str:
    """The slot of a machine in which a part of that number is, where it holds `most` parts, which
    take its slots in turn; one slot alone has the machine's name.
    """
    return machine if most == 1 else f"{machine}.{number % most + 1}"


def start_of(slot: str) -> str:
    """The signal that starts a machine with the part in a slot; cleared when that was taken."""
    return f"{slot}.start"


def done_of(slot: str) -> str:
    """The signal by which a machine says that the part in a slot is finished."""
    return f"{slot}.done"


def machines_of(cell: Cell) -> tuple[str, ...]:
    """Names of the equipment at the stations of the route."""
    return tuple(cell.station(name).equipment for name in route_of(cell).visits)


def with_signals(
    cell: Cell,
    standing: Cell,
    fronts: Mapping[str, FloatArray],
    slots: Mapping[str, Mapping[str, bool]],
) -> Cell:
    """The cell with its parts as they are `standing`, the places in front of its stations (poses
    (4, 4) of the tcp in the cell), and the signals of the slots of its machines, by machine.
    Whether a slot has a finished part when the program begins is said there. Numbers of signals
    that the cell has are kept.
    """
    stations = list(standing.stations)
    for name, pose in fronts.items():
        own = cell.station(name)
        inside = _pose_in(cell.machine(own.equipment).pose, pose)
        stations.append(Station(front_name(name), own.equipment, pose, own.zone, inside))
    signals = {signal.name: signal for signal in standing.signals}
    for machine, own_slots in slots.items():
        for slot, finished in own_slots.items():
            start = start_of(slot)
            end = done_of(slot)
            signals[start] = replace(signals.get(start, CellSignal(start)), initial=finished)
            signals[end] = replace(
                signals.get(end, CellSignal(end)),
                initial=finished,
                follows=start,
                delay=0.0,
                process=machine,
            )
    return replace(standing, stations=tuple(stations), signals=tuple(signals.values()))


def _pose_in(frame: FloatArray, pose: FloatArray) -> FloatArray:
    """A pose (4, 4) in a frame."""
    turned = frame[:3, :3].T
    inverse = np.eye(4)
    inverse[:3, :3] = turned
    inverse[:3, 3] = -portable.matmul(turned, frame[:3, 3])
    return portable.matmul(inverse, pose)
