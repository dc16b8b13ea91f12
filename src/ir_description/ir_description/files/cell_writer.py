"""A cell as text, and its content hash.

`read_cell` reads the text back as the same cell, bit for bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ir_description.cell import (
    CONFIGURATION_SEARCHES,
    Cell,
    CellSignal,
    Equipment,
    Part,
    PartRoute,
    ProgramStep,
    StateSwitch,
    Station,
    StepVia,
    ToolTilt,
)
from ir_description.files.cell_reader import FORMAT
from ir_description.files.program_reader import path_lines
from ir_description.files.rail_reader import rail_lines
from ir_description.poses import abc_from_rotation, rotation_from_abc
from ir_description.robot import Load, RobotModel, ToolLimits
from ir_description.shapes import Body, Capsule
from ir_msgs_py.plc import Signal
from ir_values.arrays import FloatArray

_DIGITS = 10
_IDENTITY = np.eye(4)


def cell_to_yaml(cell: Cell) -> str:
    """Return the cell as a cell file."""
    return "\n".join(_cell(cell)) + "\n"


def _cell(cell: Cell) -> Iterator[str]:
    """Lines of the whole file, in the order in which people write it; what has its default is left
    out.
    """
    yield f"format: {FORMAT}"
    yield f"name: {cell.name}"
    if cell.description:
        yield f"description: {_quoted(cell.description)}"
    if cell.robot.document:
        yield "robot:"
        yield from _indented(cell.robot.document.splitlines(), 2)
    else:
        yield f"robot: {cell.robot.name}"
    if cell.robot.rail is not None:
        yield "rail:"
        yield from _indented(rail_lines(cell.robot.rail, _number, _quoted), 2)
    if not np.array_equal(cell.base_pose, _IDENTITY):
        yield f"base: {{{_pose(cell.base_pose)}}}"
    if cell.base_contacts:
        yield f"base_contacts: [{', '.join(f'[{a}, {b}]' for a, b in cell.base_contacts)}]"
    yield f"floor: {_word(cell.floor)}"
    if cell.tool is not None:
        yield "tool:"
        yield from _indented(_load(cell.tool), 2)
    if not np.array_equal(cell.tcp, _IDENTITY):
        yield f"tcp: {{{_pose(cell.tcp)}}}"
    yield from _posture("home", cell.machine_home, cell.robot)
    yield from _posture("park", cell.park, cell.robot)
    yield from _block("parts", (_part(part) for part in cell.parts))
    at: dict[str, list[Station]] = {machine.name: [] for machine in cell.equipment}
    for station in cell.stations:
        at[station.equipment].append(station)
    yield from _block(
        "equipment", (_machine(machine, at[machine.name]) for machine in cell.equipment)
    )
    yield from _block("signals", ([_signal(signal)] for signal in cell.signals))
    yield from _block("program", ([_step(step)] for step in cell.program))
    yield from _block(
        "tasks",
        (
            [
                f"name: {_quoted(t.name)}",
                f"start: {_list_text(t.start)}",
                f"goal: {_list_text(t.goal)}",
            ]
            for t in cell.tasks
        ),
    )
    yield from _block("paths", (path_lines(path, _pose, _number) for path in cell.paths))
    if cell.route is not None:
        yield f"route: {_route(cell.route)}"


def _load(load: Load) -> Iterator[str]:
    yield f"name: {load.name}"
    yield f"mass: {_number(load.mass)}"
    yield f"com: {_list_text(load.com)}"
    J = load.inertia
    yield f"inertia: {_list_text((J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]))}"
    if load.kind == "tool":
        yield f"watts_always: {_number(load.watts_always)}"
        yield f"watts_drive_bus: {_number(load.watts_drive_bus)}"
    yield from _limits(load.limits)
    yield from _block("capsules", ([_capsule(capsule)] for capsule in load.capsules))


def _limits(limits: ToolLimits) -> Iterator[str]:
    fields = []
    if limits.speed:
        fields.append(f"tool_speed: {_number(limits.speed)}")
    if limits.acceleration:
        fields.append(f"tool_acceleration: {_number(limits.acceleration)}")
    if fields and limits.whole:
        fields.append("whole_tool: true")
    if fields:
        yield f"limits: {{{', '.join(fields)}}}"


def _capsule(capsule: Capsule) -> str:
    p0 = _list_text(capsule.p0)
    p1 = _list_text(capsule.p1)
    return f"{{name: {capsule.name}, p0: {p0}, p1: {p1}, radius: {_number(capsule.radius)}}}"


def _part(part: Part) -> Iterator[str]:
    yield from _load(part.load)
    if not np.array_equal(part.grasp, _IDENTITY):
        yield f"grasp: {{{_pose(part.grasp)}}}"
    if part.station:
        yield f"station: {part.station}"
    if part.tilt is not None:
        yield _tilt(part.tilt)
    yield from _block("bodies", ([_body(body)] for body in part.bodies))


def _machine(machine: Equipment, stations: list[Station]) -> Iterator[str]:
    yield f"name: {machine.name}"
    if not np.array_equal(machine.pose, _IDENTITY):
        yield f"pose: {{{_pose(machine.pose)}}}"
    if not machine.enabled:
        yield "enabled: false"
    yield _zone(machine, stations)
    if machine.states:
        yield "states:"
        for state in machine.states:
            yield f"  {state.name}: [{', '.join(state.bodies)}]"
        yield f"state: {machine.state}"
    if machine.switch is not None:
        yield f"switch: {_switch(machine.switch)}"
    if machine.process:
        yield f"process: {_process(machine)}"
    if machine.capacity > 1:
        yield f"capacity: {machine.capacity}"
    if machine.buffer > 0:
        yield f"buffer: {machine.buffer}"
    yield "bodies:" if machine.bodies else "bodies: []"
    yield from _entries([_body(body)] for body in machine.bodies)
    yield from _block("stations", (_station(station) for station in stations))


def _process(machine: Equipment) -> str:
    times = machine.process_times
    varies = ""
    if times is not None:
        ends = times.samples or (times.low, times.high)
        key = "samples" if times.samples else "between"
        varies = f", {key}: [{', '.join(_number(seconds) for seconds in ends)}]"
    return f"{{seconds: {_number(machine.process)}{varies}}}"


def _switch(switch: StateSwitch) -> str:
    ends = f"on: {switch.on}, off: {switch.off}"
    return f"{{signal: {switch.signal}, {ends}, time: {_number(switch.time)}}}"


def _zone(machine: Equipment, stations: Iterable[Station]) -> str:
    zone = machine.zone_in_equipment
    if machine.has_default_zone(stations):
        return f"zone: {zone.kind}"
    return f"zone: {{kind: {zone.kind}, size: {_list_text(zone.size)}, {_pose(zone.pose)}}}"


def _body(body: Body) -> str:
    shape = {
        "box": f", size: {_list_text(body.size)}",
        "cylinder": f", radius: {_number(body.size[0])}, length: {_number(body.size[1])}",
        "sphere": f", radius: {_number(body.size[0])}",
        "capsule": f", radius: {_number(body.size[0])}, length: {_number(body.size[1])}",
        "plane": "",
        "mesh": f", vertices: [{', '.join(_list_text(vertex) for vertex in body.vertices)}]",
    }[body.kind]
    return f"{{name: {body.name}, kind: {body.kind}{shape}, {_pose(body.pose)}}}"


def _station(station: Station) -> Iterator[str]:
    """Lines of a station; what has its default is left out."""
    yield f"name: {station.name}"
    yield f"pose: {{{_pose(station.pose_in_equipment)}}}"
    yield f"approach_distance: {_number(station.approach_distance)}"
    if station.blend:
        yield f"blend: {_number(station.blend)}"
    if station.tilt is not None:
        yield _tilt(station.tilt)
    search = station.search
    if search.configurations != CONFIGURATION_SEARCHES[0]:
        yield f"configurations: {search.configurations}"
        yield f"starts: {search.starts}"
    if search.withdrawal:
        yield f"withdrawal: {search.withdrawal}"
    yield from _limits(station.limits)
    if station.takes:
        yield f"takes: [{', '.join(station.takes)}]"
    if station.gives:
        yield f"gives: {station.gives}"
    yield from _block(
        "allowed_contacts",
        (
            [
                f"{{between: [{c.body_a}, {c.body_b}], safety_distance: "
                f"{_number(c.safety_distance)}}}"
            ]
            for c in station.allowed_contacts
        ),
    )


def _tilt(tilt: ToolTilt) -> str:
    ways = (("axis", tilt.axis), ("direction", tilt.direction))
    given = "".join(f", {key}: {_list_text(way)}" for key, way in ways if way)
    return f"tilt: {{max: {_number(tilt.most)}{given}}}"


def _signal(signal: CellSignal) -> str:
    follows = f", follows: {signal.follows}" if signal.follows else ""
    if signal.process:
        follows += f", process: {signal.process}"
    elif signal.follows:
        follows += f", delay: {_number(signal.delay)}"
    given = (("output", signal.output), ("input", signal.input))
    numbers = "".join(f", {key}: {number}" for key, number in given if number)
    return f"{{name: {signal.name}, initial: {_word(signal.initial)}{follows}{numbers}}}"


def _step(step: ProgramStep) -> str:
    fields = []
    if step.kind == "PAUSE":
        fields += [f"pause: {_number(step.dwell)}", f"power_mode: {step.power_mode}"]
        fields += [f"since: {step.since}"] if step.since else []
    else:
        fields.append(f"{step.kind.lower()}: {step.target}")
        if step.dwell:
            fields.append(f"dwell: {_number(step.dwell)}")
        if step.planner:
            fields.append(f"planner: {step.planner}")
        fields += _of_movement(step)
    for key, part in (("attach", step.attach), ("detach", step.detach)):
        if part:
            fields.append(f"{key}: {part}")
    for key, signals in (("wait_for", step.wait_for), ("set_signals", step.set_signals)):
        if signals:
            fields.append(f"{key}: {_signals(signals)}")
    return f"{{{', '.join(fields)}}}"


def _of_movement(step: ProgramStep) -> Iterator[str]:
    """What a step says of the movement to its target."""
    if step.tilt is not None:
        yield _tilt(step.tilt)
    if step.via is not None:
        yield _via(step.via)
    if step.blend is not None:
        yield f"blend: {_number(step.blend)}"


def _via(via: StepVia) -> str:
    near = f"via_tolerance: {_number(via.tolerance)}, via_distance: {_number(via.distance)}"
    return f"via: [{', '.join(via.places)}], {near}"


def _route(route: PartRoute) -> str:
    visits = "" if route.by_states else f"visits: [{', '.join(route.visits)}], "
    return f"{{part: {route.part}, {visits}handling: {_number(route.handling)}}}"


def _signals(signals: Sequence[Signal]) -> str:
    return f"[{', '.join(signal.text for signal in signals)}]"


def _posture(name: str, posture: FloatArray, robot: RobotModel) -> Iterator[str]:
    degrees = np.round(robot.in_people_units(posture), _DIGITS)
    if np.array_equal(robot.from_people_units(degrees), posture):
        yield f"{name}_deg: {_list_text(degrees)}"
    else:
        yield f"{name}: {_list_text(posture)}"


def _pose(pose: FloatArray) -> str:
    """Return the keys of a pose without braces."""
    xyz = f"xyz: {_list_text(pose[:3, 3])}"
    R = pose[:3, :3]
    if np.array_equal(R, np.eye(3)):
        return xyz
    abc = np.round(abc_from_rotation(R), _DIGITS)
    abc[abc == -180.0] = 180.0  # the same turn: a signed zero in R must not change the text
    if np.array_equal(rotation_from_abc(abc), R):
        return f"{xyz}, abc_deg: {_list_text(abc)}"
    return f"{xyz}, rotation: [{', '.join(_list_text(row) for row in R)}]"


def _block(key: str, entries: Iterable[Iterable[str]]) -> Iterator[str]:
    lines = list(_entries(entries))
    if lines:
        yield f"{key}:"
        yield from lines


def _entries(entries: Iterable[Iterable[str]]) -> Iterator[str]:
    for entry in entries:
        for i, line in enumerate(entry):
            yield ("  - " if i == 0 else "    ") + line


def _indented(lines: Iterable[str], by: int) -> Iterator[str]:
    return (" " * by + line for line in lines)


def _list_text(values: Iterable[float]) -> str:
    return f"[{', '.join(_number(value) for value in values)}]"


def _number(value: float) -> str:
    text = repr(float(value) + 0.0)  # + 0.0 turns -0.0 into 0.0
    return text.removesuffix(".0")


def _word(value: bool) -> str:
    return "true" if value else "false"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


# The content hash: of all that a plan depends on, and of nothing else.

_LENGTH = 16  # hexadecimal digits, as ids of trajectories have


def cell_hash(cell: Cell) -> str:
    """Hash of bodies, poses, states, zones, stations, loads and robot; its program, its route with
    the machines' times, and its texts don't count.

    The state of a machine that a signal switches doesn't count either: doors move while a program
    runs, and a movement that relies on a state says so. The file of a cell, written and read again,
    has the same hash.
    """
    machines = tuple(_unswitched(machine) for machine in cell.equipment)
    lying = cell.parts_at_start().lying
    place = replace(
        cell,
        description="",
        parts=tuple(replace(part, station=lying[part.name]) for part in cell.parts),
        equipment=machines,
        stations=tuple(replace(each, takes=(), gives="") for each in cell.stations),
        program=(),
        signals=(),
        tasks=(),
        paths=(),
        route=None,
    )
    content = f"{cell_to_yaml(place)}\n{cell.robot!r}"
    return hashlib.sha256(content.encode()).hexdigest()[:_LENGTH]


def _unswitched(machine: Equipment) -> Equipment:
    machine = replace(machine, process=0.0, process_times=None, capacity=1, buffer=0)
    if machine.switch is None:
        return machine
    return replace(machine, state=machine.states[0].name, switch=None)
