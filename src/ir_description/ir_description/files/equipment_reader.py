"""Entries of a cell file that have a shape: bodies, machines, the tool and parts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TypeVar

import numpy as np

from ir_description.cell import (
    APPROACH_MAX,
    BLEND_MAX,
    BODIES_MAX,
    CAPACITY_MAX,
    CONFIGURATION_SEARCHES,
    PROCESS_MAX,
    SAMPLES_MAX,
    STARTS_MAX,
    SWITCH_MAX,
    ZONE_KINDS,
    ZONE_MAX,
    AllowedContact,
    CellPath,
    Equipment,
    EquipmentState,
    NameRegister,
    Part,
    ProcessTimes,
    StateSwitch,
    Station,
    StationSearch,
    ToolTilt,
    Zone,
    station_at,
    zone_around,
)
from ir_description.files.point_cloud import CloudReader
from ir_description.files.robot_file import inertia_matrix
from ir_description.files.solid_reader import SolidReader, piece_names
from ir_description.files.stl_mesh import (
    CELL_TRIANGLES_MAX,
    CORNERS_MAX,
    HULL_VERTICES_MAX,
    convex_vertices,
    hull_vertices,
    mesh_path,
    read_stl,
)
from ir_description.poses import (
    pose_of,
    rotation_from_abc,
    rotation_from_matrix,
    rotation_from_quaternion,
)
from ir_description.robot import (
    MASS_MAX,
    TOOL_ACCELERATION_MAX,
    TOOL_SPEED_MAX,
    UNLIMITED,
    Load,
    ToolLimits,
)
from ir_description.shapes import KINDS, SIZE_MAX, Body, Capsule
from ir_kernels import portable
from ir_values.arrays import FloatArray, solid_box_inertia
from ir_values.errors import InvalidValueError
from ir_values.yaml_items import Item, Table

# Poses and bodies.

_Stop = TypeVar("_Stop", Station, CellPath)
POSE_KEYS = ("xyz", "abc_deg", "quaternion", "rotation")
FAR = 1000.0
"""Farthest place [m] of anything in a cell."""


def read_pose(item: Item) -> FloatArray:
    """Return the pose (4, 4) of a mapping with POSE_KEYS."""
    return pose_in(item.table((), POSE_KEYS))


def pose_in(table: Table) -> FloatArray:
    """Return the pose (4, 4) of xyz [m] and one of abc_deg, quaternion (x, y, z, w) or rotation
    (rows).
    """
    xyz = table["xyz"].numbers(3, -FAR, FAR, "m") if "xyz" in table else np.zeros(3)
    if not any(key in table for key in POSE_KEYS[1:]):
        return pose_of(xyz)
    key = table.one_of(*POSE_KEYS[1:])
    item = table[key]
    with item.blamed():
        if key == "abc_deg":
            rotation = rotation_from_abc(item.numbers(3, -360.0, 360.0, "deg"))
        elif key == "quaternion":
            rotation = rotation_from_quaternion(item.numbers(4, -2.0, 2.0))
        else:
            rotation = rotation_from_matrix(item.rows(3, -2.0, 2.0, count=(3, 3)))
    return pose_of(xyz, rotation)


class BodyReader:
    """Reads bodies, each with a name that no other body or capsule has."""

    def __init__(self, shapes: NameRegister, folder: Path | None) -> None:
        self._shapes = shapes
        self._folder = folder
        self._count = 0
        self._corners = 0
        self._triangles = 0
        self._meshes: dict[tuple[str, bool], FloatArray] = {}
        self._solids = SolidReader(folder)
        self._clouds = CloudReader(folder)
        self.pieces: dict[str, tuple[str, ...]] = {}
        """Names of the bodies that stand for a mesh or a point cloud, by its name."""

    def all(self, items: Iterable[Item]) -> tuple[Body, ...]:
        """Return the bodies of a list; a mesh from CAD becomes one body for each of its convex
        pieces, a point cloud one for each of its boxes.
        """
        found: list[Body] = []
        for item in items:
            if item.holds("mesh"):
                found += self._divided(item)
            elif item.holds("cloud"):
                found += self._boxes(item)
            else:
                found.append(self.read(item))
        return tuple(found)

    def named(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return names of bodies, with the pieces of a mesh or a cloud instead of its name."""
        return tuple(piece for name in names for piece in self.pieces.get(name, (name,)))

    def at_pieces(self, stop: _Stop) -> _Stop:
        """Return a station or a path whose contacts name the pieces of meshes."""
        contacts = (
            AllowedContact(*pair, contact.safety_distance)
            for contact in stop.allowed_contacts
            for pair in product(self.named((contact.body_a,)), self.named((contact.body_b,)))
        )
        return replace(stop, allowed_contacts=tuple(contacts))

    def _divided(self, item: Item) -> list[Body]:
        table = item.table(("name", "mesh"), (*POSE_KEYS, "unit", "pieces"))
        pose = pose_in(table)
        solid = self._solids.read(table)
        names = self._named_pieces(table, len(solid))
        bodies = []
        for name, vertices in zip(names, solid, strict=True):
            self._counted(item, len(vertices))
            bodies.append(Body(name, "mesh", pose, np.zeros(3), vertices))
        return bodies

    def _boxes(self, item: Item) -> list[Body]:
        table = item.table(
            ("name", "cloud", "unit", "margin"), (*POSE_KEYS, "voxel", "pitch", "crop")
        )
        pose = pose_in(table)
        boxes = self._clouds.read(table)
        bodies = []
        for number, name in enumerate(self._named_pieces(table, len(boxes.lower))):
            self._counted(item, 0)
            lower = boxes.lower[number]
            upper = boxes.upper[number]
            at = portable.matmul(pose, pose_of((lower + upper) / 2.0))
            bodies.append(Body(name, "box", at, upper - lower))
        return bodies

    def _named_pieces(self, table: Table, count: int) -> tuple[str, ...]:
        """Take the name of an entry, and those of the bodies that stand for it."""
        name = table["name"].name()
        names = piece_names(name, count)
        with table["name"].blamed():
            self._shapes.add(name)
            for piece in names:
                if piece != name:
                    self._shapes.add(piece)
        self.pieces[name] = names
        return names

    def _counted(self, item: Item, corners: int) -> None:
        """Refuse what is too much."""
        self._count += 1
        if self._count > BODIES_MAX:
            item.fail(f"is one body too many, a cell has at most {BODIES_MAX}")
        self._corners += corners
        if self._corners > CORNERS_MAX:
            item.fail(
                f"is one mesh too many: all have {self._corners} corners, at most {CORNERS_MAX} "
                "are taken"
            )

    def read(self, item: Item) -> Body:
        """Return one body; its keys depend on its kind."""
        table = item.table(
            ("name", "kind"),
            (*POSE_KEYS, "size", "radius", "length", "file", "scale", "convex_hull", "vertices"),
        )
        name = table["name"].name()
        with table["name"].blamed():
            self._shapes.add(name)
        kind = table["kind"].choice(KINDS)
        shape = _SHAPE_KEYS[kind]
        for key in _ALL_SHAPE_KEYS:
            if key in table and key not in shape:
                table[key].fail(
                    f"does not belong to a {kind}; its keys are "
                    f"{', '.join(shape) or 'only its pose'}"
                )
        size, vertices = (
            self._mesh(table) if kind == "mesh" else (_size(table, kind), np.zeros((0, 3)))
        )
        self._counted(item, len(vertices))
        with item.blamed():
            return Body(name, kind, pose_in(table), size, vertices)  # type: ignore[arg-type]

    def _mesh(self, table: Table) -> tuple[FloatArray, FloatArray]:
        key = table.one_of("file", "vertices")
        if key == "vertices":
            for other in ("scale", "convex_hull"):
                if other in table:
                    table[other].fail("belongs to a mesh with a file")
            points = table["vertices"].rows(3, -FAR, FAR, "m", count=(4, HULL_VERTICES_MAX))
            with table["vertices"].blamed():
                return np.zeros(3), hull_vertices(points)
        item = table["file"]
        name = item.text()
        scale = table["scale"].number(0, 1000, above=True) if "scale" in table else 1.0
        take_hull = table["convex_hull"].boolean() if "convex_hull" in table else False
        with item.blamed():
            if (name, take_hull) not in self._meshes:
                self._meshes[name, take_hull] = convex_vertices(self._read(name), take_hull)
            vertices = self._meshes[name, take_hull] * scale
            if np.abs(vertices).max() > FAR:
                raise InvalidValueError(
                    f"the mesh reaches {np.abs(vertices).max():g} m, must stay within {FAR:g} m "
                    "(scale: 0.001 for mm)"
                )
        return np.zeros(3), vertices

    def _read(self, name: str) -> FloatArray:
        """Return the triangles (T, 3, 3) of a mesh file, in its unit."""
        if self._folder is None:
            raise InvalidValueError(
                "a mesh file can be named only in a cell file, this is a text; give its vertices"
            )
        triangles = read_stl(mesh_path(self._folder, name))
        self._triangles += len(triangles)
        if self._triangles > CELL_TRIANGLES_MAX:
            raise InvalidValueError(
                f"the cell's mesh files have {self._triangles} triangles so far, "
                f"must have at most {CELL_TRIANGLES_MAX} together"
            )
        return triangles


_SHAPE_KEYS: dict[str, tuple[str, ...]] = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "plane": (),
    "mesh": ("file", "scale", "convex_hull", "vertices"),
}
_ALL_SHAPE_KEYS = ("size", "radius", "length", "file", "scale", "convex_hull", "vertices")


def _size(table: Table, kind: str) -> FloatArray:
    """Return size (3,) [m] as Body wants it."""
    for key in _SHAPE_KEYS[kind]:
        if key not in table:
            table.item.fail(f"has no {key}; a {kind} has {', '.join(_SHAPE_KEYS[kind])}")
    if kind == "box":
        return table["size"].numbers(3, 0.0, SIZE_MAX, "m", above=True)
    lengths = np.zeros(3)
    if "radius" in table:
        lengths[0] = table["radius"].number(0.0, SIZE_MAX, "m", above=True)
    if "length" in table:
        lengths[1] = table["length"].number(0.0, SIZE_MAX, "m", above=kind == "cylinder")
    return lengths


_MACHINE_KEYS = (
    "pose",
    "zone",
    "states",
    "state",
    "switch",
    "enabled",
    "process",
    "capacity",
    "buffer",
    "stations",
)
STATES_MAX = 20
"""Most states of a part that one station takes."""
_SEARCH_KEYS = ("configurations", "starts", "withdrawal")


def read_equipment(item: Item, bodies: BodyReader) -> tuple[Equipment, list[tuple[Item, Station]]]:
    """Return a machine and its stations, each with the item it came from."""
    table = item.table(("name", "bodies"), _MACHINE_KEYS)
    read = bodies.all(table["bodies"].list(0, BODIES_MAX))
    states = _states(table, bodies)
    process, times = _process(table["process"]) if "process" in table else (0.0, None)
    machine = Equipment(
        name=table["name"].name(),
        pose=_pose(table),
        bodies=read,
        zone_in_equipment=_zone(table, read),
        states=states,
        state=_state(table, states),
        enabled=table["enabled"].boolean() if "enabled" in table else True,
        switch=_switch(table["switch"], states) if "switch" in table else None,
        process=process,
        process_times=times,
        capacity=table["capacity"].integer(1, CAPACITY_MAX) if "capacity" in table else 1,
        buffer=table["buffer"].integer(0, CAPACITY_MAX) if "buffer" in table else 0,
    )
    items = table["stations"].list(0, 10_000) if "stations" in table else []
    stations = [_station(station, machine) for station in items]
    machine = replace(machine, zone_in_equipment=_zone(table, read, stations))
    return machine, list(zip(items, stations, strict=True))


def _pose(table: Table) -> FloatArray:
    return read_pose(table["pose"]) if "pose" in table else np.eye(4)


def _zone(table: Table, bodies: tuple[Body, ...], stations: Iterable[Station] = ()) -> Zone:
    """A word is the kind around bodies and stations, a mapping may give the box."""
    tcps = [station.pose_in_equipment[:3, 3] for station in stations]
    item = table.get("zone")
    if item is None or item.is_scalar():
        kind = "OPEN" if item is None else item.choice(ZONE_KINDS)
        with (item or table.item).blamed():
            return zone_around(kind, bodies, tcps)  # type: ignore[arg-type]
    zone = item.table(("kind",), ("size", *POSE_KEYS))
    kind = zone["kind"].choice(ZONE_KINDS)
    with item.blamed():
        if "size" not in zone:
            for key in POSE_KEYS:
                if key in zone:
                    zone[key].fail("belongs to a zone with a size")
            return zone_around(kind, bodies, tcps)  # type: ignore[arg-type]
        size = zone["size"].numbers(3, 0.0, ZONE_MAX, "m", above=True)
        return Zone(kind, pose_in(zone), size)  # type: ignore[arg-type]


def _states(table: Table, bodies: BodyReader) -> tuple[EquipmentState, ...]:
    if "states" not in table:
        return ()
    return tuple(
        EquipmentState(name, bodies.named(body.name() for body in item.list(0, 1000)))
        for name, item in table["states"].pairs()
    )


def _state(table: Table, states: tuple[EquipmentState, ...]) -> str:
    if "state" in table:
        return table["state"].name()
    if states:
        table.item.fail(
            f"has states and must say its state, one of {', '.join(state.name for state in states)}"
        )
    return ""


def _switch(item: Item, states: tuple[EquipmentState, ...]) -> StateSwitch:
    table = item.table(("signal", "on", "off"), ("time",))
    known = tuple(state.name for state in states)
    if not known:
        item.fail("belongs to a machine with states")
    on = table["on"].choice(known)
    off = table["off"].choice(known)
    time = table["time"].number(0.0, SWITCH_MAX, "s") if "time" in table else 0.0
    with item.blamed():
        return StateSwitch(table["signal"].name(), on, off, time)


def _process(item: Item) -> tuple[float, ProcessTimes | None]:
    """Seconds that plans count with, and how they vary."""
    table = item.table((), ("seconds", "between", "samples"))
    times = _process_times(table)
    if "seconds" in table:
        return table["seconds"].number(0.0, PROCESS_MAX, "s", above=True), times
    if times is None:
        item.fail("has no seconds, must have seconds, between or samples")
    return times.mean, times


def _process_times(table: Table) -> ProcessTimes | None:
    """Between two ends, or samples; None for neither."""
    if "between" in table and "samples" in table:
        table["samples"].fail("stands beside between, must be one of both")
    if "samples" in table:
        items = table["samples"].list(1, SAMPLES_MAX)
        return ProcessTimes.of([one.number(0.0, PROCESS_MAX, "s", above=True) for one in items])
    if "between" not in table:
        return None
    low, high = table["between"].numbers(2, 0.0, PROCESS_MAX, "s")
    if not 0.0 < low <= high:
        table["between"].fail(f"is {low:g} to {high:g} s, must rise and be above 0 s")
    return ProcessTimes(float(low), float(high))


_STATE_KEYS = ("takes", "gives")
_STATION_KEYS = (
    "approach_distance",
    "allowed_contacts",
    "tilt",
    "limits",
    "blend",
    *_STATE_KEYS,
    *_SEARCH_KEYS,
)


def _station(item: Item, machine: Equipment) -> Station:
    table = item.table(("name", "pose"), _STATION_KEYS)
    contacts = table["allowed_contacts"].list(0, 1000) if "allowed_contacts" in table else []
    approach = table.get("approach_distance")
    return station_at(
        machine,
        table["name"].name(),
        read_pose(table["pose"]),
        tuple(read_contact(contact) for contact in contacts),
        0.0 if approach is None else approach.number(0.0, APPROACH_MAX, "m"),
        _search(table),
        read_tilt(table),
        _limits(table),
        _state_names(table["takes"]) if "takes" in table else (),
        table["gives"].name() if "gives" in table else "",
        table["blend"].number(0.0, BLEND_MAX, "m") if "blend" in table else 0.0,
    )


def _state_names(item: Item) -> tuple[str, ...]:
    """One state of a part, or several."""
    if item.is_scalar():
        return (item.name(),)
    return tuple(each.name() for each in item.list(1, STATES_MAX))


def read_tilt(table: Table) -> ToolTilt | None:
    """Return how far the tool may lean; None where there is no `tilt`."""
    if "tilt" not in table:
        return None
    given = table["tilt"].table((), ("max", "max_deg", "axis", "direction"))
    if given.one_of("max", "max_deg") == "max":
        most = given["max"].number(0.0, math.pi, "rad")
    else:
        most = math.radians(given["max_deg"].number(0.0, 180.0, "deg"))
    ways = {
        key: tuple(given[key].numbers(3, -FAR, FAR).tolist())
        for key in ("axis", "direction")
        if key in given
    }
    with table["tilt"].blamed():
        return ToolTilt(most, **ways)


def _search(table: Table) -> StationSearch:
    default = StationSearch()
    configurations = (
        table["configurations"].choice(CONFIGURATION_SEARCHES)
        if "configurations" in table
        else default.configurations
    )
    if "starts" in table and configurations != "ccd":
        table["starts"].fail("belongs to a station with configurations: ccd")
    starts = table["starts"].integer(1, STARTS_MAX) if "starts" in table else default.starts
    withdrawal = table["withdrawal"].name() if "withdrawal" in table else ""
    return StationSearch(configurations, starts, withdrawal)


def _limits(table: Table) -> ToolLimits:
    """How fast the tool may move, of a load or a station; as the axes allow where nothing is
    said.
    """
    if "limits" not in table:
        return UNLIMITED
    given = table["limits"].table((), ("tool_speed", "tool_acceleration", "whole_tool"))
    speed = given.get("tool_speed")
    acceleration = given.get("tool_acceleration")
    if speed is None and acceleration is None:
        table["limits"].fail("must have tool_speed or tool_acceleration")
    return ToolLimits(
        0.0 if speed is None else speed.number(0.0, TOOL_SPEED_MAX, "m/s", above=True),
        0.0
        if acceleration is None
        else acceleration.number(0.0, TOOL_ACCELERATION_MAX, "m/s^2", above=True),
        given["whole_tool"].boolean() if "whole_tool" in given else False,
    )


def read_contact(item: Item) -> AllowedContact:
    """A pair with the distance that it must keep at its station or along its path."""
    table = item.table(("between", "safety_distance"))
    first, second = table["between"].list(2, 2)
    with item.blamed():
        return AllowedContact(
            first.name(), second.name(), table["safety_distance"].number(0.0, 10.0, "m")
        )


# The tool and the parts.

_MASS_KEYS = ("inertia", "inertia_box", "capsules", "limits")


def read_tool(item: Item, link: int, shapes: NameRegister) -> Load:
    """Return the tool; its capsules stand on `link`."""
    table = item.table(("name", "mass", "com"), (*_MASS_KEYS, "watts_always", "watts_drive_bus"))
    mass = table["mass"].number(0.0, MASS_MAX, "kg", above=True)
    return Load(
        name=table["name"].name(),
        kind="tool",
        mass=mass,
        com=table["com"].numbers(3, -FAR, FAR, "m"),
        inertia=_inertia(table, mass),
        capsules=_capsules(table, link, shapes),
        watts_always=_watts(table, "watts_always"),
        watts_drive_bus=_watts(table, "watts_drive_bus"),
        limits=_limits(table),
    )


def read_part(item: Item, link: int, shapes: NameRegister, bodies: BodyReader) -> Part:
    """Return a part: its load in its own frame, its bodies, its grasp and where it lies."""
    table = item.table(("name", "mass", "com"), (*_MASS_KEYS, "bodies", "grasp", "station", "tilt"))
    mass = table["mass"].number(0.0, MASS_MAX, "kg", above=True)
    load = Load(
        name=table["name"].name(),
        kind="part",
        mass=mass,
        com=table["com"].numbers(3, -FAR, FAR, "m"),
        inertia=_inertia(table, mass),
        capsules=_capsules(table, link, shapes),
        limits=_limits(table),
    )
    return Part(
        load=load,
        bodies=bodies.all(table["bodies"].list(0, 100)) if "bodies" in table else (),
        grasp=read_pose(table["grasp"]) if "grasp" in table else np.eye(4),
        station=table["station"].name() if "station" in table else "",
        tilt=read_tilt(table),
    )


def _inertia(table: Table, mass: float) -> FloatArray:
    key = table.one_of("inertia", "inertia_box")
    item = table[key]
    with item.blamed():
        if key == "inertia_box":
            return solid_box_inertia(mass, item.numbers(3, 0.0, 100.0, "m", above=True))
        return inertia_matrix(item.numbers(6, -1e6, 1e6, "kg m^2"))


def _capsules(table: Table, link: int, shapes: NameRegister) -> tuple[Capsule, ...]:
    return (
        tuple(_capsule(item, link, shapes) for item in table["capsules"].list(0, 200))
        if "capsules" in table
        else ()
    )


def _capsule(item: Item, link: int, shapes: NameRegister) -> Capsule:
    table = item.table(("name", "p0", "p1", "radius"))
    name = table["name"].name()
    with table["name"].blamed():
        shapes.add(name)
    return Capsule(
        name=name,
        link=link,
        p0=table["p0"].numbers(3, -FAR, FAR, "m"),
        p1=table["p1"].numbers(3, -FAR, FAR, "m"),
        radius=table["radius"].number(0.0, 100.0, "m", above=True),
    )


def _watts(table: Table, key: str) -> float:
    return table[key].number(0.0, 1e5, "W") if key in table else 0.0
