"""Reads poses and bodies of a cell file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TypeVar

import numpy as np

from ir_description.cell import BODIES_MAX, AllowedContact, CellPath, NameRegister, Station
from ir_description.files.items import Item, Table
from ir_description.files.mesh import (
    CELL_TRIANGLES_MAX,
    CORNERS_MAX,
    HULL_VERTICES_MAX,
    convex_vertices,
    hull_vertices,
    mesh_path,
    read_stl,
)
from ir_description.files.solid_reader import SolidReader, piece_names
from ir_description.poses import (
    pose_of,
    rotation_from_abc,
    rotation_from_matrix,
    rotation_from_quaternion,
)
from ir_description.shapes import KINDS, SIZE_MAX, Body
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

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
        self._count = self._corners = self._triangles = 0
        self._meshes: dict[tuple[str, bool], FloatArray] = {}
        self._solids = SolidReader(folder)
        self.pieces: dict[str, tuple[str, ...]] = {}
        """Names of the bodies that stand for a mesh, by its name."""

    def all(self, items: Iterable[Item]) -> tuple[Body, ...]:
        """Return the bodies of a list; a mesh from CAD becomes one body for each of its convex
        pieces.
        """
        found: list[Body] = []
        for item in items:
            if item.holds("mesh"):
                found += self._divided(item)
            else:
                found.append(self.read(item))
        return tuple(found)

    def named(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return names of bodies, with the pieces of a mesh instead of its name."""
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
        table = item.table(("name", "mesh", "unit"), (*POSE_KEYS, "pieces"))
        name = table["name"].name()
        with table["name"].blamed():
            self._shapes.add(name)
        pose = pose_in(table)
        solid = self._solids.read(table)
        names = piece_names(name, len(solid))
        bodies = []
        for number, (piece, vertices) in enumerate(zip(names, solid, strict=True)):
            with table["name"].blamed():
                if number or piece != name:
                    self._shapes.add(piece)
            self._counted(item, len(vertices))
            bodies.append(Body(piece, "mesh", pose, np.zeros(3), vertices))
        self.pieces[name] = names
        return bodies

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
