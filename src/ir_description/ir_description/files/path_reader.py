"""Paths of the tool in a cell file, or in a file of their own, and back to text."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import MISSING, fields
from typing import Any

from ir_description.cell import CellPath, NameRegister
from ir_description.errors import CellFileError
from ir_description.files.body_reader import read_pose
from ir_description.files.equipment_reader import read_contact
from ir_description.files.items import Item, Table, read_items
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import (
    KINDS,
    LINE,
    ORIENTATIONS,
    POSES_MAX,
    CartesianPath,
    CartesianSegment,
)

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
        return _path(root.table(("start", "segments"), _NAMES))


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
            paths.append(CellPath(name, _path(table), machine, tuple(map(read_contact, contacts))))
    return tuple(paths)


def _path(table: Table) -> CartesianPath:
    segments = tuple(_segment(item) for item in table["segments"].list(1, POSES_MAX))
    given: dict[str, Any] = {}
    for name in _NAMES:
        if name == "orientation" and name in table:
            given[name] = table[name].choice(ORIENTATIONS)
        elif name in table:
            given[name] = table[name].number(-_FAR, _FAR)
    return CartesianPath(read_pose(table["start"]), segments, **given)


def _segment(item: Item) -> CartesianSegment:
    table = item.table((), (*KINDS, "tool_speed"))
    kind = table.one_of(*KINDS)
    poses = (table[kind],) if kind == LINE else table[kind].list(1, POSES_MAX)
    speed = table["tool_speed"].number(0.0, _FAR, "m/s") if "tool_speed" in table else 0.0
    with item.blamed():
        return CartesianSegment(kind, tuple(read_pose(pose) for pose in poses), speed)


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
        yield f"  - {{{segment.kind}: {drawn}{speed}}}"
