"""What must hold between the things of a cell: unique names, known names, a payload the robot
carries.

The rules are small objects and functions so that the reader of cell files can ask each at the line
it reads.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Protocol

from ir_description.cell.equipment import AllowedContact, Equipment, Station
from ir_description.cell.part import Part
from ir_description.cell.program import POSTURES, CellSignal, PartPlaces, ProgramStep
from ir_description.cell.tool_path import CellPath
from ir_description.errors import UnknownNameError
from ir_description.robot import Load, RobotModel, total_mass
from ir_description.shapes import Body, Capsule
from ir_msgs_py.errors import InvalidValueError

BODIES_MAX = 10_000
"""Most bodies a cell may have."""


class _Named(Protocol):
    @property
    def name(self) -> str: ...


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
    if step.kind == "PATH" and step.target not in paths:
        raise UnknownNameError("path", step.target, paths)
    for signal in (*step.wait_for, *step.set_signals):
        if signal.name not in signals:
            raise UnknownNameError("signal", signal.name, signals)
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
    """Refuse a base contact that is not a capsule of base_link with a body."""
    base = [c.name for c in robot.capsules if c.link == 0]
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


def check_single_places(parts: Iterable[Part]) -> None:
    """Refuse two parts that lie at one station."""
    register = NameRegister("a part at station")
    for part in parts:
        if part.station:
            register.add(part.station)


def _load_capsules(cell: _Cell) -> tuple[Capsule, ...]:
    loads = (*((cell.tool,) if cell.tool is not None else ()), *(part.load for part in cell.parts))
    return tuple(capsule for load in loads for capsule in load.capsules)


def _all_bodies(cell: _Cell) -> tuple[Body, ...]:
    machines = (body for machine in cell.equipment for body in machine.bodies)
    return (*machines, *(body for part in cell.parts for body in part.bodies))
