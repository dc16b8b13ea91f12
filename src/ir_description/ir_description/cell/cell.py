"""A cell: one robot with its tool, the equipment around it, the parts, and the program.

Its rules (unique names, known names, a payload that the robot carries) are small objects and
functions, so that the reader of cell files can ask each at the line that it reads.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeVar

import numpy as np

from ir_description.cell.equipment import (
    AllowedContact,
    CellPath,
    Equipment,
    Part,
    Station,
)
from ir_description.cell.part_routes import check_route, part_routes
from ir_description.cell.program import (
    POSTURES,
    CellSignal,
    PartPlaces,
    PartRoute,
    ProgramStep,
)
from ir_description.cell.zones import Zone, zone_around
from ir_description.poses import composed, inverse
from ir_description.robot import Load, RobotModel, total_mass
from ir_description.shapes import Body, Capsule, floor_body
from ir_kernels import portable
from ir_msgs_py.cartesian import CartesianPath
from ir_values.arrays import FloatArray, frozen, frozen_pose
from ir_values.errors import InvalidValueError, UnknownNameError

BODIES_MAX = 10_000
"""Most bodies a cell may have."""
_LEVEL = 1e-6  # of the direction of a rail: it keeps its height above the floor


class _Cell(Protocol):
    """The things of a cell, whatever else it is."""

    @property
    def robot(self) -> RobotModel: ...
    @property
    def tool(self) -> Load | None: ...
    @property
    def parts(self) -> tuple[Part, ...]: ...
    @property
    def equipment(self) -> tuple[Equipment, ...]: ...
    @property
    def stations(self) -> tuple[Station, ...]: ...
    @property
    def signals(self) -> tuple[CellSignal, ...]: ...
    @property
    def program(self) -> tuple[ProgramStep, ...]: ...
    @property
    def paths(self) -> Sequence[CellPath]: ...

    @property
    def tasks(self) -> Sequence[_Named]: ...
    @property
    def base_contacts(self) -> tuple[tuple[str, str], ...]: ...
    def parts_at_start(self) -> PartPlaces: ...


class NameRegister:
    """Names of one kind, each given once."""

    def __init__(self, what: str, taken: Iterable[str] = ()) -> None:
        self._what = what
        self._names = dict.fromkeys(taken)

    def __iter__(self) -> Iterable[str]:
        return iter(self._names)

    def add(self, name: str) -> None:
        """Take a name; the second of the same name is refused."""
        if name in self._names:
            raise InvalidValueError(f"{self._what} {name} is there twice")
        self._names[name] = None


def shape_register(robot: RobotModel) -> NameRegister:
    """Return the register of all capsules and bodies: a reported pair must be clear by its
    names.
    """
    return NameRegister("capsule or body", [*(capsule.name for capsule in robot.capsules), "floor"])


def check_contact(
    contact: AllowedContact, capsules: Collection[str], bodies: Collection[str]
) -> None:
    """Refuse an allowed contact whose names nobody has, or without a capsule of robot, tool or
    part.
    """
    for name in (contact.body_a, contact.body_b):
        if name not in capsules and name not in bodies:
            raise UnknownNameError("capsule or body", name, sorted(capsules) + sorted(bodies))
    if contact.body_a not in capsules and contact.body_b not in capsules:
        raise InvalidValueError(
            f"allowed contact {contact.body_a}, {contact.body_b} has no capsule of robot, tool "
            f"or part; capsules are {', '.join(sorted(capsules))}"
        )


def check_step(
    step: ProgramStep,
    before: PartPlaces,
    stations: Collection[str],
    signals: Collection[str],
    paths: Collection[str] = (),
) -> PartPlaces:
    """Return where the parts are after a step; refuse unknown names and what can't be done."""
    if step.kind == "STATION" and step.target not in stations:
        raise UnknownNameError("station", step.target, stations)
    for place in step.via.places if step.via is not None else ():
        if place not in (*stations, *POSTURES):
            raise UnknownNameError("via place", place, (*stations, *POSTURES))
    if step.kind == "PATH" and step.target not in paths:
        raise UnknownNameError("path", step.target, paths)
    for signal in (*step.wait_for, *step.set_signals):
        if signal.name not in signals:
            raise UnknownNameError("signal", signal.name, signals)
    if step.since and step.since not in signals:
        raise UnknownNameError("signal", step.since, signals)
    return before.after(step)


def check_part_mass(robot: RobotModel, tool: Load | None, part: Load | None = None) -> None:
    """Refuse a tool, or a tool with a part, beyond the rated payload."""
    loads = tuple(load for load in (tool, part) if load is not None)
    mass = total_mass(loads)
    if mass > robot.rated_payload:
        names = " and ".join(load.name for load in loads)
        raise InvalidValueError(
            f"{names}: mass is {mass:g} kg, {robot.name} carries at most {robot.rated_payload:g} kg"
        )


def check_follows(signals: Iterable[CellSignal]) -> None:
    """Refuse a signal that follows one nobody has."""
    signals = tuple(signals)
    names = dict.fromkeys(signal.name for signal in signals)
    for signal in signals:
        if signal.follows and signal.follows not in names:
            raise UnknownNameError(f"signal that {signal.name} follows", signal.follows, names)


def check_numbers(signals: Iterable[CellSignal]) -> None:
    """Refuse two signals with the same output, or the same input."""
    taken: dict[tuple[str, int], str] = {}
    for signal in signals:
        for what, number in (("output", signal.output), ("input", signal.input)):
            other = taken.setdefault((what, number), signal.name)
            if number and other != signal.name:
                raise InvalidValueError(
                    f"{what} of {signal.name} is {number}, which {other} has already"
                )


def check_processes(signals: Iterable[CellSignal], machines: Iterable[Equipment]) -> None:
    """Refuse a signal that reports a process that no machine has."""
    working = [machine.name for machine in machines if machine.process > 0.0]
    for signal in signals:
        if signal.process and signal.process not in working:
            raise UnknownNameError(
                f"machine with a process that {signal.name} reports", signal.process, working
            )


def check_switch(machine: Equipment, signals: Collection[str]) -> None:
    """Refuse a machine whose switch names a signal that nobody has."""
    if machine.switch is not None and machine.switch.signal not in signals:
        raise UnknownNameError(
            f"signal that switches {machine.name}", machine.switch.signal, signals
        )


def check_names(cell: _Cell) -> None:  # noqa: C901
    """Refuse names that are given twice or that nobody has."""
    shapes = shape_register(cell.robot)
    for shape in _load_capsules(cell):
        shapes.add(shape.name)
    for body in _all_bodies(cell):
        shapes.add(body.name)
    for what, things in (
        ("equipment", cell.equipment),
        ("station", cell.stations),
        ("part", cell.parts),
        ("signal", cell.signals),
        ("task", cell.tasks),
        ("path", cell.paths),
    ):
        register = NameRegister(what)
        for thing in things:
            register.add(thing.name)
    stations = dict.fromkeys(station.name for station in cell.stations)
    stops = NameRegister("station or path", (*stations, *POSTURES) if cell.paths else ())
    for path in cell.paths:
        stops.add(path.name)
    machines = dict.fromkeys(machine.name for machine in cell.equipment)
    for part in cell.parts:
        if part.station and part.station not in stations:
            raise UnknownNameError(f"station of part {part.name}", part.station, stations)
    for station in cell.stations:
        if station.equipment not in machines:
            raise UnknownNameError(
                f"equipment of station {station.name}", station.equipment, machines
            )
    check_follows(cell.signals)
    check_processes(cell.signals, cell.equipment)
    check_numbers(cell.signals)
    signals = dict.fromkeys(signal.name for signal in cell.signals)
    for machine in cell.equipment:
        check_switch(machine, signals)
    if sum(len(machine.bodies) for machine in cell.equipment) > BODIES_MAX:
        raise InvalidValueError(f"the cell has more than {BODIES_MAX} bodies")


def check_payload(cell: _Cell) -> None:
    """Refuse loads that the robot can't carry."""
    check_part_mass(cell.robot, cell.tool)
    for part in cell.parts:
        check_part_mass(cell.robot, cell.tool, part.load)


def check_contacts(cell: _Cell) -> None:
    """Refuse allowed contacts and base contacts with names that nobody has."""
    capsules = {capsule.name for capsule in (*cell.robot.capsules, *_load_capsules(cell))}
    bodies = {body.name for body in _all_bodies(cell)} | {"floor"}
    for station in cell.stations:
        for contact in station.allowed_contacts:
            check_contact(contact, capsules, bodies)
    for path in cell.paths:
        check_path(
            path, dict.fromkeys(machine.name for machine in cell.equipment), capsules, bodies
        )
    for capsule, body in cell.base_contacts:
        check_base_contact(cell.robot, capsule, body, bodies)


def check_path(
    path: CellPath, machines: Collection[str], capsules: Collection[str], bodies: Collection[str]
) -> None:
    """Refuse a path at a machine that nobody has, or with contacts of such names."""
    if path.equipment and path.equipment not in machines:
        raise UnknownNameError(f"equipment of path {path.name}", path.equipment, machines)
    for contact in path.allowed_contacts:
        check_contact(contact, capsules, bodies)


def check_base_contact(robot: RobotModel, capsule: str, body: str, bodies: Collection[str]) -> None:
    """Refuse a base contact that is not a capsule of base_link, or of its carriage, with a body."""
    base = [c.name for c in robot.capsules if c.link <= robot.base]
    if capsule not in base:
        raise UnknownNameError("capsule of base_link", capsule, base)
    if body not in bodies:
        raise UnknownNameError("body", body, bodies)


def check_program(cell: _Cell) -> None:
    """Refuse a program with unknown names or with parts where they can't be."""
    state = cell.parts_at_start()
    stations = dict.fromkeys(station.name for station in cell.stations)
    signals = dict.fromkeys(signal.name for signal in cell.signals)
    paths = dict.fromkeys(path.name for path in cell.paths)
    for step in cell.program:
        state = check_step(step, state, stations, signals, paths)


def places_before(
    parts: Iterable[Part],
    equipment: Iterable[Equipment],
    stations: Iterable[Station],
    route: PartRoute | None,
) -> PartPlaces:
    """Where the parts of a cell are before its program."""
    machines = {machine.name: machine.places for machine in equipment if route is not None}
    held = {station.name: machines.get(station.equipment, 1) for station in stations}
    rooms = {name: places for name, places in held.items() if places > 1}
    inside = {part.name: part.station for part in parts if part.station in rooms}
    lying = {part.name: "" if part.name in inside else part.station for part in parts}
    return PartPlaces("", lying, route=route, rooms=rooms, inside=inside)


def check_part_place(part: Part, start: PartPlaces) -> None:
    """Refuse a part at a station where as many as it holds are at the start."""
    if part.station:
        there = start.at(part.station)[: start.rooms.get(part.station, 1)]
        if part.name not in there:
            raise InvalidValueError(
                f"{part.name} can't be at station {part.station}, {' and '.join(there)} "
                f"{'is' if len(there) == 1 else 'are'} there"
            )


def _load_capsules(cell: _Cell) -> tuple[Capsule, ...]:
    loads = (*((cell.tool,) if cell.tool is not None else ()), *(part.load for part in cell.parts))
    return tuple(capsule for load in loads for capsule in load.capsules)


def _all_bodies(cell: _Cell) -> tuple[Body, ...]:
    machines = (body for machine in cell.equipment for body in machine.bodies)
    return (*machines, *(body for part in cell.parts for body in part.bodies))


class _Named(Protocol):
    @property
    def name(self) -> str: ...


_T = TypeVar("_T", bound=_Named)


@dataclass(frozen=True, eq=False)
class Task:
    """A movement to plan: start and goal configuration (n,) [rad]."""

    name: str
    start: FloatArray
    goal: FloatArray


@dataclass(frozen=True, eq=False)
class Cell:
    """base_pose (4, 4) of base_link in the world, on a rail where that is at 0; tcp (4, 4) in the
    last link.

    park and machine_home (n,) [rad, of a rail m] are the two named postures. base_contacts: pairs
    of a capsule of base_link and a body that touch for good (a pedestal); `ignored_pairs` adds the
    floor.
    whole_loads: each stands for the tool and a part together where a program says what it carries
    ($LOAD), the first at the start; none: tool and parts as they are.
    route: what the machines with a process do to the parts, None: there are none.
    """

    name: str
    robot: RobotModel
    base_pose: FloatArray
    tool: Load | None
    tcp: FloatArray
    parts: tuple[Part, ...]
    equipment: tuple[Equipment, ...]
    stations: tuple[Station, ...]
    signals: tuple[CellSignal, ...]
    park: FloatArray
    machine_home: FloatArray
    program: tuple[ProgramStep, ...]
    tasks: tuple[Task, ...] = ()
    paths: tuple[CellPath, ...] = ()
    floor: bool = True
    base_contacts: tuple[tuple[str, str], ...] = ()
    description: str = field(default="")
    whole_loads: tuple[Load, ...] = ()
    route: PartRoute | None = None

    def __post_init__(self) -> None:
        n = self.robot.n
        object.__setattr__(self, "base_pose", frozen_pose(self.base_pose, "base_pose"))
        object.__setattr__(self, "tcp", frozen_pose(self.tcp, "tcp"))
        for name in ("park", "machine_home"):
            posture = frozen(getattr(self, name), (n,), name)
            object.__setattr__(self, name, posture)
            check_posture(self.robot, posture, name)
        for task in self.tasks:
            check_posture(
                self.robot, frozen(task.start, (n,), "start"), f"start of task {task.name}"
            )
            check_posture(self.robot, frozen(task.goal, (n,), "goal"), f"goal of task {task.name}")
        check_names(self)
        start = self.parts_at_start()
        for part in self.parts:
            check_part_place(part, start)
        check_payload(self)
        check_contacts(self)
        check_program(self)
        if self.route is not None:
            check_route(self.route, self.parts, self.equipment, self.stations)

    def station(self, name: str) -> Station:
        """Return the station of that name."""
        return _named(self.stations, "station", name)

    def part(self, name: str) -> Part:
        """Return the part of that name."""
        return _named(self.parts, "part", name)

    def machine(self, name: str) -> Equipment:
        """Return the equipment of that name."""
        return _named(self.equipment, "equipment", name)

    def task(self, name: str) -> Task:
        """Return the task of that name."""
        return _named(self.tasks, "task", name)

    def path(self, name: str) -> CartesianPath:
        """Return the path of the tool of that name."""
        return self.own_path(name).path

    def own_path(self, name: str) -> CellPath:
        """Return the same with what it allows to touch."""
        return _named(self.paths, "path", name)

    def contacts_at(self, stop: str) -> tuple[AllowedContact, ...]:
        """Return the pairs that may touch at the station or along the path of that name."""
        return self._stop(stop).allowed_contacts

    def zone_at(self, stop: str) -> Zone | None:
        """Return the zone of its machine, in which they may; None for a path that belongs to
        none.
        """
        machine = self._stop(stop).equipment
        return self.machine(machine).zone if machine else None

    def _stop(self, name: str) -> Station | CellPath:
        stops: tuple[Station | CellPath, ...] = (*self.stations, *self.paths)
        return _named(stops, "station", name)

    def posture(self, name: str) -> FloatArray:
        """Return the joint values (n,) [rad] of "home" or "park". Raises UnknownNameError for
        another one.
        """
        if name not in ("home", "park"):
            raise UnknownNameError("posture", name, ("home", "park"))
        return self.machine_home if name == "home" else self.park

    def cycle_start(self, stations: Sequence[str] = ()) -> str:
        """The posture in which a visit of `stations`, or the program, begins in production: where
        it ends, as the next cycle follows; "park" where it ends at a station.
        """
        stops = tuple(stations) or tuple(step.target for step in self.program if step.target)
        return stops[-1] if stops and stops[-1] in POSTURES else "park"

    def bodies(self, parts: PartPlaces | None = None) -> tuple[Body, ...]:
        """Return all bodies in the world: the floor, the enabled equipment as it stands, the parts
        that lie.

        `parts` says where the parts are; None: where they are before the program starts.
        """
        parts = parts or self.parts_at_start()
        floor = (floor_body(),) if self.floor else ()
        machines = tuple(body for machine in self.equipment for body in machine.world_bodies())
        lying = tuple(
            body
            for name, station in parts.lying.items()
            if station
            for body in self.part(name).lying(self.station(station).pose)
        )
        return (*floor, *machines, *lying)

    def loads(self, held: str = "") -> tuple[Load, ...]:
        """Return the tool and the held part ("" for none) in the frame of the last link."""
        tool = (self.tool,) if self.tool is not None else ()
        return (*tool, self.part(held).held(self.tcp)) if held else tool

    def capsules(self, held: str = "") -> tuple[Capsule, ...]:
        """Return the capsules of the robot, its tool and the held part."""
        return (*self.robot.capsules, *(c for load in self.loads(held) for c in load.capsules))

    def self_pairs(self, held: str = "") -> tuple[tuple[str, str], ...]:
        """Return the pairs of capsules that can touch: every load against the robot, and the
        robot's own.
        """
        loads = tuple(
            (capsule.name, other)
            for load in self.loads(held)
            for capsule in load.capsules
            for other in self.robot.load_self_capsules
        )
        return (*loads, *self.robot.self_pairs)

    @property
    def ignored_pairs(self) -> tuple[tuple[str, str], ...]:
        """Pairs of a capsule of base_link and a body that touch for good, the floor among them,
        unless a rail leads to it.
        """
        robot = self.robot
        base = robot.base
        if robot.rail is not None:
            climbs = abs(float(portable.matmul(self.base_pose[2, :3], robot.rail.axis)))
            base = 0 if climbs > _LEVEL else base
        named = tuple((c.name, "floor") for c in robot.capsules if c.link <= base and self.floor)
        return (*named, *self.base_contacts)

    @property
    def part_routes(self) -> tuple[PartRoute, ...]:
        """All ways of the parts of its route; () without one."""
        route = self.route
        if route is None:
            return ()
        if not route.by_states:
            return (route,)
        return part_routes(route.part, route.handling, self.parts, self.stations)

    def parts_at_start(self) -> PartPlaces:
        """Return where the parts are before the program's first step."""
        carrying = self.whole_loads[0].name if self.whole_loads else ""
        places = places_before(self.parts, self.equipment, self.stations, self.route)
        return replace(places, carrying=carrying)

    def loads_at(self, places: PartPlaces) -> tuple[Load, ...]:
        """Return what is carried while the parts are at `places`."""
        if places.carrying:
            return (self.whole_load(places.carrying),)
        return self.loads(places.held)

    def whole_load(self, name: str) -> Load:
        """Return the whole load of that name."""
        return _named(self.whole_loads, "load", name)

    def with_equipment(
        self,
        name: str,
        pose: FloatArray | None = None,
        enabled: bool | None = None,
        state: str | None = None,
    ) -> Cell:
        """Return the cell with a machine moved, switched on or off, or in another state; stations
        follow.
        """
        old = self.machine(name)
        new = replace(
            old,
            pose=old.pose if pose is None else pose,
            enabled=old.enabled if enabled is None else enabled,
            state=old.state if state is None else state,
        )
        return replace(
            self,
            equipment=tuple(new if machine is old else machine for machine in self.equipment),
            stations=tuple(_moved(station, new) for station in self.stations),
            paths=tuple(_moved_path(path, old, new) for path in self.paths),
        )

    def with_station(self, name: str, pose_in_equipment: FloatArray) -> Cell:
        """Return the cell with a station elsewhere at its machine, whose default zone follows."""
        old = self.station(name)
        machine = self.machine(old.equipment)
        moved = old.moved(machine, pose_in_equipment)
        stations = tuple(moved if station is old else station for station in self.stations)
        mine = [
            tuple(s for s in each if s.equipment == machine.name)
            for each in (self.stations, stations)
        ]
        equipment = self.equipment
        if machine.has_default_zone(mine[0]):
            tcps = [station.pose_in_equipment[:3, 3] for station in mine[1]]
            zone = zone_around(machine.zone_in_equipment.kind, machine.bodies, tcps)
            new = replace(machine, zone_in_equipment=zone)
            equipment = tuple(new if each is machine else each for each in equipment)
        return replace(self, stations=stations, equipment=equipment)


def check_posture(robot: RobotModel, posture: FloatArray, name: str) -> None:
    """Refuse joint values (n,) [rad] beyond the robot's limits."""
    for i, value in enumerate(posture):
        low = robot.position_min[i]
        high = robot.position_max[i]
        if not low <= value <= high:
            raise InvalidValueError(
                f"{name}: {robot.joint_names[i]} is {robot.shown(i, value)}, must be in "
                f"{robot.shown_range(i)}"
            )


def _moved(station: Station, machine: Equipment) -> Station:
    if station.equipment != machine.name:
        return station
    return station.moved(machine, station.pose_in_equipment)


def _moved_path(path: CellPath, old: Equipment, new: Equipment) -> CellPath:
    if path.equipment != new.name or np.array_equal(old.pose, new.pose):
        return path
    return path.moved(composed(new.pose, inverse(old.pose)))


def _named(items: Iterable[_T], what: str, name: str) -> _T:
    items = tuple(items)
    for item in items:
        if item.name == name:
            return item
    raise UnknownNameError(what, name, (item.name for item in items))
