"""Reads a cell file into a Cell. The format: docs/cell_format.md.

Errors stand at the line that is wrong: every rule between the things of a cell is asked while its
line is at hand.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from ir_description.cell import (
    ROBOT_COUNT,
    Cell,
    CellPath,
    CellSignal,
    Equipment,
    NameRegister,
    Part,
    PartPlaces,
    PartRoute,
    ProgramStep,
    RobotCells,
    Station,
    check_base_contact,
    check_contact,
    check_follows,
    check_numbers,
    check_part_mass,
    check_part_place,
    check_path,
    check_posture,
    check_processes,
    check_route,
    check_step,
    check_switch,
    places_before,
    shape_register,
)
from ir_description.files.equipment_reader import (
    BodyReader,
    read_equipment,
    read_part,
    read_pose,
    read_tool,
)
from ir_description.files.program_reader import (
    PATHS_MAX,
    read_paths,
    read_route,
    read_signals,
    read_step,
    read_tasks,
)
from ir_description.files.rail_reader import read_rail
from ir_description.files.robot_file import read_robot, robot_of
from ir_description.robot import Load, RobotModel, on_rail
from ir_values.arrays import FloatArray
from ir_values.errors import CellFileError, InvalidValueError, RobotFileError, UnknownNameError
from ir_values.files import inside, is_path
from ir_values.yaml_errors import document_errors
from ir_values.yaml_items import Item, Table, read_items

FORMAT = "ir_cell/1"
ROBOT_MARK = "@"
"""Between the name of a cell with several robots and that of one of them."""
RobotSource = Callable[[str], RobotModel]
_T = TypeVar("_T")

_REQUIRED = ("format", "name", "robot")
_SHARED = ("description", "floor", "parts", "equipment", "signals")
_OF_ROBOT = (
    "base",
    "base_contacts",
    "rail",
    "tool",
    "tcp",
    "home",
    "home_deg",
    "park",
    "park_deg",
    "program",
    "tasks",
    "paths",
)
_OPTIONAL = (*_SHARED, *_OF_ROBOT, "route")


def read_cell(text: str, source: str, robots: RobotSource, folder: Path | None) -> Cell:
    """Return the cell of a text; robots gives a robot by name, folder is where its meshes are."""
    return cell_of(read_items(text, source, CellFileError), robots, folder)


def read_robot_cells(
    text: str, source: str, robots: RobotSource, folder: Path | None
) -> RobotCells | None:
    """Return the cells of a text with several robots; None: it has one."""
    if "robots" not in text:
        return None
    root = read_items(text, source, CellFileError)
    return robot_cells_of(root, robots, folder) if root.holds("robots") else None


def cell_of(root: Item, robots: RobotSource, folder: Path | None) -> Cell:
    """Return the cell of a document with one robot."""
    if root.holds("robots"):
        names = robot_cells_of(root, robots, folder).robots
        root.fail(
            f"the file has the robots {', '.join(names)}, here one is needed: write its name "
            f"behind that of the cell or the file, as CELL{ROBOT_MARK}{names[0]}"
        )
    table = root.table(_REQUIRED, _OPTIONAL)
    table["format"].choice((FORMAT,))
    return _CellReader(root, table, _robot_of(table, robots, folder), folder).cell()


def robot_cells_of(root: Item, robots: RobotSource, folder: Path | None) -> RobotCells:
    """Return the cells of a document with several robots."""
    shared = root.table(("format", "name", "robots"), _SHARED)
    shared["format"].choice((FORMAT,))
    entries = shared["robots"].list(*ROBOT_COUNT)
    tables = [entry.table(("name", "robot"), (*_OF_ROBOT, "starts")) for entry in entries]
    for table in tables:
        if "rail" in table:
            table["rail"].fail("a cell with several robots has none on a rail yet: one robot alone")
    models = [_robot(table["robot"], robots, folder) for table in tables]
    tools = [_tool_capsules(table, model) for table, model in zip(tables, models, strict=True)]
    cells = []
    for k, (table, model) in enumerate(zip(tables, models, strict=True)):
        others = {name for tool in tools for name in tool} - set(tools[k])
        reader = _CellReader(entries[k], shared.joined(table), model, folder, others)
        cells.append((table["name"].name(), reader.cell()))
    with shared["robots"].blamed():
        return RobotCells.of(shared["name"].name(), cells, cells[0][1].description)


def _tool_capsules(table: Table, robot: RobotModel) -> list[str]:
    """Names of the capsules of a robot's tool."""
    item = table.get("tool")
    if item is None:
        return []
    with item.blamed():
        tool = read_tool(item, robot.n, shape_register(robot))
    return [capsule.name for capsule in tool.capsules]


def cell_errors(
    text: str, source: str, robots: RobotSource, folder: Path | None
) -> tuple[CellFileError, ...]:
    """All errors of the text of a cell, by line; none: it can be read."""

    def read(root: Item) -> object:
        several = root.holds("robots")
        return (robot_cells_of if several else cell_of)(root, robots, folder)

    return document_errors(text, source, CellFileError, read)


def _robot_of(table: Table, robots: RobotSource, folder: Path | None) -> RobotModel:
    """The robot of a cell, on its rail where there is one."""
    arm = _robot(table["robot"], robots, folder)
    item = table.get("rail")
    if item is None:
        return arm
    rail = read_rail(item)
    with item.blamed():
        return on_rail(arm, rail)


def _robot(item: Item, robots: RobotSource, folder: Path | None) -> RobotModel:
    """A bundled robot by its name, one in a file beside the cell file, or one that is written
    out.
    """
    if not item.is_scalar():
        return robot_of(item, folder)
    if not is_path(item.text()):
        with item.blamed():
            return robots(item.name())
    with item.blamed():
        path = inside(folder, item.text())
        try:
            return read_robot(path)
        except RobotFileError as error:
            raise InvalidValueError(str(error)) from error


class _Placed(NamedTuple):
    """Something read, with the item it came from."""

    item: Item
    station: Station


class _CellReader:
    """One reading: what has been named so far. foreign: capsules of other robots' tools."""

    def __init__(
        self,
        root: Item,
        table: Table,
        robot: RobotModel,
        folder: Path | None,
        foreign: Collection[str] = (),
    ) -> None:
        self._root = root
        self._table = table
        self._foreign = foreign
        self._robot = robot
        self._shapes = shape_register(robot)
        self._bodies = BodyReader(self._shapes, folder)
        self._capsules = [capsule.name for capsule in robot.capsules]
        self._tool_names: list[str] = []

    def cell(self) -> Cell:
        """The cell of the whole tree. Each check stands behind the last value that it needs, so
        that a sentence names the line that is at fault.
        """
        table = self._table
        robot = self._robot
        base_pose = _pose(table.get("base"))
        tcp = _pose(table.get("tcp"))
        tool = self._tool()
        parts = self._read_parts(tool)
        equipment, placed = self._equipment()
        stations = tuple(entry.station for entry in placed)
        self._check_part_stations(parts, stations)
        paths = tuple(map(self._bodies.at_pieces, read_paths(self._list("paths", PATHS_MAX))))
        self._check_contacts(placed, paths, equipment, parts)
        signals = self._signals()
        self._check_switches(equipment, signals)
        if "signals" in self._table:
            with self._table["signals"].blamed():
                check_processes(signals, equipment)
        route = self._route(parts, equipment, stations)
        places = places_before(parts, equipment, stations, route)
        for item, part in zip(self._list("parts", 1000), parts, strict=True):
            with item.blamed():
                check_part_place(part, places)
        home = self._posture("home", robot.machine_home)
        with self._root.blamed():
            return Cell(
                name=table["name"].name(),
                description=table["description"].text(1000) if "description" in table else "",
                robot=robot,
                base_pose=base_pose,
                tool=tool,
                tcp=tcp,
                parts=parts,
                equipment=equipment,
                stations=stations,
                signals=signals,
                park=self._posture("park", home),
                machine_home=home,
                program=self._program(stations, paths, signals, places),
                tasks=read_tasks(self._list("tasks", 10_000), self._robot),
                paths=paths,
                floor=table["floor"].boolean() if "floor" in table else True,
                base_contacts=self._base_contacts(equipment, parts),
                route=route,
            )

    def _list(self, key: str, high: int) -> list[Item]:
        item = self._table.get(key)
        return [] if item is None else item.list(0, high)

    def _tool(self) -> Load | None:
        item = self._table.get("tool")
        if item is None:
            return None
        with item.blamed():
            tool = read_tool(item, self._robot.n, self._shapes)
            check_part_mass(self._robot, tool)
        self._tool_names = [capsule.name for capsule in tool.capsules]
        self._capsules += self._tool_names
        return tool

    def _read_parts(self, tool: Load | None) -> tuple[Part, ...]:
        names = NameRegister("part")
        parts = []
        for item in self._list("parts", 1000):
            with item.blamed():
                part = read_part(item, self._robot.n, self._shapes, self._bodies)
                names.add(part.name)
                check_part_mass(self._robot, tool, part.load)
            self._capsules += [capsule.name for capsule in part.load.capsules]
            parts.append(part)
        return tuple(self._at_start(parts))

    def _at_start(self, parts: list[Part]) -> list[Part]:
        """The parts where they lie when the program of this robot begins."""
        item = self._table.get("starts")
        if item is None:
            return parts
        known = [part.name for part in parts]
        starts = {}
        for name, place in item.pairs():
            with place.blamed():
                if name not in known:
                    raise UnknownNameError("part", name, known)
            starts[name] = place.name()
        return [replace(part, station=starts.get(part.name, part.station)) for part in parts]

    def _equipment(self) -> tuple[tuple[Equipment, ...], list[_Placed]]:
        names = NameRegister("equipment")
        station_names = NameRegister("station")
        machines = []
        placed = []
        for item in self._list("equipment", 10_000):
            with item.blamed():
                machine, stations = read_equipment(item, self._bodies)
                names.add(machine.name)
            machines.append(machine)
            for station_item, station in stations:
                with station_item.blamed():
                    station_names.add(station.name)
                placed.append(_Placed(station_item, station))
        return tuple(machines), [self._own_contacts(each) for each in placed]

    def _own_contacts(self, placed: _Placed) -> _Placed:
        """A station with the contacts that this robot can make."""
        station = self._bodies.at_pieces(placed.station)
        own = []
        for contact in station.allowed_contacts:
            pair = (contact.body_a, contact.body_b)
            others = [name for name in pair if name in self._foreign]
            if len(others) == 2 or (others and set(pair) & set(self._tool_names)):
                placed.item.fail(
                    f"allows {pair[0]} and {pair[1]} to touch: robots keep apart everywhere"
                )
            if not others:
                own.append(contact)
        return _Placed(placed.item, replace(station, allowed_contacts=tuple(own)))

    def _check_part_stations(self, parts: tuple[Part, ...], stations: tuple[Station, ...]) -> None:
        known = dict.fromkeys(station.name for station in stations)
        for item, part in zip(self._list("parts", 1000), parts, strict=True):
            with item.blamed():
                if part.station and part.station not in known:
                    raise UnknownNameError("station", part.station, known)

    def _check_contacts(
        self,
        placed: list[_Placed],
        paths: tuple[CellPath, ...],
        equipment: tuple[Equipment, ...],
        parts: tuple[Part, ...],
    ) -> None:
        capsules = set(self._capsules)
        bodies = _body_names(equipment, parts)
        machines = [machine.name for machine in equipment]
        for item, path in zip(self._list("paths", PATHS_MAX), paths, strict=True):
            with item.blamed():
                check_path(path, machines, capsules, bodies)
        for entry in placed:
            with entry.item.blamed():
                for contact in entry.station.allowed_contacts:
                    check_contact(contact, capsules, bodies)

    def _base_contacts(
        self, equipment: tuple[Equipment, ...], parts: tuple[Part, ...]
    ) -> tuple[tuple[str, str], ...]:
        bodies = _body_names(equipment, parts)
        pairs = []
        for item in self._list("base_contacts", 1000):
            first, second = item.list(2, 2)
            for name in self._bodies.named((second.name(),)):
                pair = (first.name(), name)
                with item.blamed():
                    check_base_contact(self._robot, *pair, bodies)
                pairs.append(pair)
        return tuple(pairs)

    def _signals(self) -> tuple[CellSignal, ...]:
        given = self._table.get("signals")
        if given is None:
            return ()
        names = NameRegister("signal")
        signals: list[CellSignal] = []
        for item, signal in read_signals(given, 1000):
            with item.blamed():
                names.add(signal.name)
                check_numbers((*signals, signal))
            signals.append(signal)
        with given.blamed():
            check_follows(signals)
        return tuple(signals)

    def _check_switches(
        self, equipment: tuple[Equipment, ...], signals: tuple[CellSignal, ...]
    ) -> None:
        known = dict.fromkeys(signal.name for signal in signals)
        for item, machine in zip(self._list("equipment", 10_000), equipment, strict=True):
            with dict(item.pairs()).get("switch", item).blamed():
                check_switch(machine, known)

    def _route(
        self,
        parts: tuple[Part, ...],
        equipment: tuple[Equipment, ...],
        stations: tuple[Station, ...],
    ) -> PartRoute | None:
        item = self._table.get("route")
        if item is None:
            return None
        with item.blamed():
            route = read_route(item, parts, stations)
            check_route(route, parts, equipment, stations)
        return route

    def _posture(self, name: str, default: FloatArray) -> FloatArray:
        given = [key for key in (name, f"{name}_deg") if key in self._table]
        if not given:
            return default
        key = self._table.one_of(name, f"{name}_deg")
        item = self._table[key]
        degrees = key.endswith("_deg")
        values = item.numbers(self._robot.n, -3600.0, 3600.0, "deg" if degrees else "rad")
        posture = self._robot.from_people_units(values) if degrees else values
        with item.blamed():
            try:
                check_posture(self._robot, posture, name)
            except InvalidValueError as error:
                meant = _other_angle_unit(key, values, self._robot)
                raise InvalidValueError(f"{error}{meant}") from error
        return posture

    def _program(
        self,
        stations: tuple[Station, ...],
        paths: tuple[CellPath, ...],
        signals: tuple[CellSignal, ...],
        places: PartPlaces,
    ) -> tuple[ProgramStep, ...]:
        named = [dict.fromkeys(each.name for each in kind) for kind in (stations, signals, paths)]
        steps = []
        for item in self._list("program", 10_000):
            with item.blamed():
                step = read_step(item)
                places = check_step(step, places, *named)
            steps.append(step)
        return tuple(steps)


def _pose(item: Item | None) -> FloatArray:
    return np.eye(4) if item is None else read_pose(item)


def _body_names(equipment: tuple[Equipment, ...], parts: tuple[Part, ...]) -> set[str]:
    machines = {body.name for machine in equipment for body in machine.bodies}
    return machines | {body.name for part in parts for body in part.bodies} | {"floor"}


def _other_angle_unit(key: str, values: FloatArray, robot: RobotModel) -> str:
    """Whether joint values (n,) beyond the limits are meant in the other unit than that of
    `key`.
    """
    degrees = key.endswith("_deg")
    meant = values if degrees else robot.from_people_units(values)
    if not ((meant >= robot.position_min) & (meant <= robot.position_max)).all():
        return ""
    name = key.removesuffix("_deg")
    return (
        f"; {key} is in {'degrees' if degrees else 'radians'}, write "
        f"{name if degrees else f'{name}_deg'}?"
    )
