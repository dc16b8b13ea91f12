"""Entries of a cell file that have an order: signals, program steps, tasks, paths of the tool."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import MISSING, fields
from typing import Any, TypedDict

from ir_description.cell import (
    BLEND_MAX,
    NUMBER_MAX,
    PAUSE_MAX,
    PAUSE_POWER_MODES,
    POSTURES,
    VIA_DISTANCE_MAX,
    VIA_MAX,
    VIA_TOLERANCES,
    VISITS,
    CellPath,
    CellSignal,
    NameRegister,
    Part,
    PartRoute,
    ProgramStep,
    Station,
    StepVia,
    Task,
    check_posture,
    part_routes,
)
from ir_description.files.equipment_reader import read_contact, read_pose, read_tilt
from ir_description.robot import RobotModel
from ir_msgs_py.cartesian import (
    KINDS,
    LINE,
    ORIENTATIONS,
    POSES_MAX,
    CartesianPath,
    CartesianSegment,
)
from ir_msgs_py.plc import Signal
from ir_values.arrays import FloatArray
from ir_values.errors import CellFileError
from ir_values.yaml_items import Item, Table, read_items

_COMMON = ("wait_for", "set_signals")
_STEP_KEYS = (
    *(
        "station",
        "posture",
        "path",
        "pause",
        "dwell",
        "attach",
        "detach",
        "power_mode",
        "planner",
        "tilt",
        "via",
        "via_tolerance",
        "via_distance",
        "blend",
        "since",
    ),
    *_COMMON,
)
_PASSED = ("via", "via_tolerance", "via_distance", "blend")
_KEYS = {
    "station": ("station", "dwell", "attach", "detach", "planner", "tilt", *_PASSED, *_COMMON),
    "posture": ("posture", "dwell", "planner", "tilt", *_PASSED, *_COMMON),
    "path": ("path", "dwell", "planner", *_COMMON),
    "pause": ("pause", "power_mode", "since", *_COMMON),
}


class _Moving(TypedDict):
    """What every step that goes somewhere has."""

    dwell: float
    wait_for: tuple[Signal, ...]
    set_signals: tuple[Signal, ...]
    planner: str


def read_signals(item: Item, high: int) -> list[tuple[Item, CellSignal]]:
    """Return the signals of the cell, at most `high`, from a list or from a mapping by their
    names.
    """
    if not item.is_mapping():
        return [(one, _cell_signal(one)) for one in item.list(0, high)]
    named = item.pairs()
    if len(named) > high:
        item.fail(f"has {len(named)} signals, must have at most {high}")
    return [(one, _cell_signal(one, name)) for name, one in named]


def _cell_signal(item: Item, named: str = "") -> CellSignal:
    table = item.table(
        () if named else ("name",), ("initial", "follows", "delay", "process", "output", "input")
    )
    if "delay" in table and "follows" not in table:
        table["delay"].fail("belongs to a signal that follows another")
    numbers = {
        key: table[key].integer(1, NUMBER_MAX) for key in ("output", "input") if key in table
    }
    with item.blamed():
        return CellSignal(
            name=named or table["name"].name(),
            initial=table["initial"].boolean() if "initial" in table else False,
            follows=table["follows"].name() if "follows" in table else "",
            delay=table["delay"].number(0.0, PAUSE_MAX, "s") if "delay" in table else 0.0,
            process=table["process"].name() if "process" in table else "",
            **numbers,
        )


def read_step(item: Item) -> ProgramStep:
    """Return one step; exactly one of station, posture, path and pause says what it is."""
    table = item.table((), _STEP_KEYS)
    kind = table.one_of("station", "posture", "path", "pause")
    for key in _STEP_KEYS:
        if key in table and key not in _KEYS[kind]:
            table[key].fail(
                f"does not belong to a {kind} step; its keys are {', '.join(_KEYS[kind])}"
            )
    wait_for = _signals(table, "wait_for")
    set_signals = _signals(table, "set_signals")
    if kind == "pause":
        mode = (
            table["power_mode"].choice(PAUSE_POWER_MODES)
            if "power_mode" in table
            else PAUSE_POWER_MODES[0]
        )
        return ProgramStep(
            kind="PAUSE",
            dwell=table["pause"].number(0.0, PAUSE_MAX, "s", above=True),
            wait_for=wait_for,
            set_signals=set_signals,
            power_mode=mode,
            since=table["since"].name() if "since" in table else "",
        )
    moving: _Moving = {
        "dwell": table["dwell"].number(0.0, PAUSE_MAX, "s") if "dwell" in table else 0.0,
        "wait_for": wait_for,
        "set_signals": set_signals,
        "planner": table["planner"].name() if "planner" in table else "",
    }
    tilt = read_tilt(table)
    via = _via(table)
    blend = table["blend"].number(0.0, BLEND_MAX, "m") if "blend" in table else None
    if kind == "posture":
        posture = table["posture"].choice(POSTURES)
        with item.blamed():
            return ProgramStep("POSTURE", posture, tilt=tilt, via=via, blend=blend, **moving)
    if kind == "path":
        return ProgramStep("PATH", table["path"].name(), **moving)
    return ProgramStep(
        kind="STATION",
        target=table["station"].name(),
        attach=table["attach"].name() if "attach" in table else "",
        detach=table["detach"].name() if "detach" in table else "",
        tilt=tilt,
        via=via,
        blend=blend,
        **moving,
    )


def _via(table: Table) -> StepVia | None:
    """What a movement passes; None where there is no `via`."""
    limits = {
        "tolerance": (*VIA_TOLERANCES, "rad"),
        "distance": (0.0, VIA_DISTANCE_MAX, "m"),
    }
    given = {
        name: table[f"via_{name}"].number(*bounds)
        for name, bounds in limits.items()
        if f"via_{name}" in table
    }
    if "via" not in table:
        for name in given:
            table[f"via_{name}"].fail("belongs to a step with via")
        return None
    return StepVia(tuple(item.name() for item in table["via"].list(1, VIA_MAX)), **given)


def read_route(item: Item, parts: Collection[Part], stations: Sequence[Station]) -> PartRoute:
    """Return the route of a part; without visits, the shortest way that its states leave."""
    table = item.table(("part",), ("visits", "handling"))
    part = table["part"].name()
    handling = table["handling"].number(0.0, PAUSE_MAX, "s") if "handling" in table else 0.0
    if "visits" not in table:
        return part_routes(part, handling, parts, stations)[0]
    visits = [visit.name() for visit in table["visits"].list(*VISITS)]
    with table["visits"].blamed():
        return PartRoute(part, tuple(visits), handling)


def _signals(table: Table, key: str) -> tuple[Signal, ...]:
    if key not in table:
        return ()
    return tuple(_signal(item) for item in table[key].list(0, 100))


def _signal(item: Item) -> Signal:
    text = item.text(80)
    inverted = text.startswith("not ")
    name = text.removeprefix("not ").strip() if inverted else text
    if not name.replace("_", "").replace(".", "").replace("-", "").isalnum():
        item.fail(f"is {name!r}, must be a signal's name, perhaps after 'not '")
    return Signal(name, not inverted)


# Tasks: movements to plan from one configuration to another.


def read_tasks(items: list[Item], robot: RobotModel) -> tuple[Task, ...]:
    """Return the tasks of a robot."""
    names = NameRegister("task")
    tasks = []
    for item in items:
        row = item.table(("name", "start", "goal"))
        with row["name"].blamed():
            name = row["name"].text(64)
            names.add(name)
        ends = []
        for key in ("start", "goal"):
            posture = row[key].numbers(robot.n, -70.0, 70.0, "rad")
            with row[key].blamed():
                check_posture(robot, posture, f"{key} of {name}")
            ends.append(posture)
        tasks.append(Task(name, *ends))
    return tuple(tasks)


# Paths of the tool in a cell file, or in a file of their own, and back to text.

PATHS_MAX = 1000
_SETTINGS = tuple(field for field in fields(CartesianPath) if field.default is not MISSING)
_NAMES = tuple(field.name for field in _SETTINGS)
_FAR = 1e6


def path_from_yaml(text: str, source: str) -> CartesianPath:
    """The path of a file with the keys of a cell file's path but for its name. Raises
    CellFileError.
    """
    root = read_items(text, source, CellFileError)
    with root.blamed():
        return _path_of_table(root.table(("start", "segments"), _NAMES))


def read_paths(items: list[Item]) -> tuple[CellPath, ...]:
    """The named paths of a cell."""
    names = NameRegister("path")
    paths = []
    for item in items:
        table = item.table(
            ("name", "start", "segments"), (*_NAMES, "equipment", "allowed_contacts")
        )
        contacts = table["allowed_contacts"].list(0, 1000) if "allowed_contacts" in table else []
        machine = table["equipment"].name() if "equipment" in table else ""
        with item.blamed():
            name = table["name"].name()
            names.add(name)
            paths.append(
                CellPath(name, _path_of_table(table), machine, tuple(map(read_contact, contacts)))
            )
    return tuple(paths)


def _path_of_table(table: Table) -> CartesianPath:
    segments = tuple(_segment(item) for item in table["segments"].list(1, POSES_MAX))
    given: dict[str, Any] = {}
    for name in _NAMES:
        if name == "orientation" and name in table:
            given[name] = table[name].choice(ORIENTATIONS)
        elif name in table:
            given[name] = table[name].number(-_FAR, _FAR)
    return CartesianPath(read_pose(table["start"]), segments, **given)


def _segment(item: Item) -> CartesianSegment:
    table = item.table((), (*KINDS, "tool_speed", "rotation_speed"))
    kind = table.one_of(*KINDS)
    poses = (table[kind],) if kind == LINE else table[kind].list(1, POSES_MAX)
    speed = table["tool_speed"].number(0.0, _FAR, "m/s") if "tool_speed" in table else 0.0
    turns = table["rotation_speed"].number(0.0, _FAR, "rad/s") if "rotation_speed" in table else 0.0
    with item.blamed():
        return CartesianSegment(kind, tuple(read_pose(pose) for pose in poses), speed, turns)


def path_lines(
    named: CellPath, pose: Callable[[FloatArray], str], number: Callable[[float], str]
) -> Iterator[str]:
    """The lines of a path in a cell file; `pose` writes the keys of a pose (4, 4), `number` a
    number.
    """
    path = named.path
    yield f"name: {named.name}"
    if named.equipment:
        yield f"equipment: {named.equipment}"
    if named.allowed_contacts:
        yield "allowed_contacts:"
    for contact in named.allowed_contacts:
        pair = f"[{contact.body_a}, {contact.body_b}]"
        yield f"  - {{between: {pair}, safety_distance: {number(contact.safety_distance)}}}"
    for field in _SETTINGS:
        value = getattr(path, field.name)
        if value != field.default:
            yield f"{field.name}: {value if isinstance(value, str) else number(value)}"
    yield f"start: {{{pose(path.start)}}}"
    yield "segments:"
    for segment in path.segments:
        poses = ", ".join(f"{{{pose(one)}}}" for one in segment.poses)
        drawn = poses if segment.kind == LINE else f"[{poses}]"
        speed = f", tool_speed: {number(segment.tool_speed)}" if segment.tool_speed else ""
        turns = segment.rotation_speed
        speed += f", rotation_speed: {number(turns)}" if turns else ""
        yield f"  - {{{segment.kind}: {drawn}{speed}}}"
