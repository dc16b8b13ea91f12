"""Machines of a world in SDF or URDF: static models and links, their collision shapes, meshes
beside it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
from scipy.spatial import ConvexHull

from ir_description.cell import NameRegister
from ir_description.errors import shown
from ir_description.files.mesh import is_closed, read_regular_file
from ir_description.files.piece_cache import pieces_of
from ir_description.files.solid_mesh import read_solid
from ir_description.files.solid_reader import PIECES, piece_names
from ir_description.poses import composed, pose_of, rotation_from_abc
from ir_description.shapes import Body
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

BYTES_MAX = 8_000_000
BODIES_MAX = 10_000
_NO_NAME = re.compile(r"[^A-Za-z0-9_.-]+")
_CONVEX = 1e-6  # share of the volume by which a hull may be larger


@dataclass(frozen=True, eq=False)
class WorldMachine:
    """A model or link: its name, its pose (4, 4) in the world, and its bodies in its frame."""

    name: str
    pose: FloatArray
    bodies: tuple[Body, ...]


@dataclass(frozen=True, eq=False)
class World:
    """The machines of a file, and what of it was left out, in words."""

    name: str
    machines: tuple[WorldMachine, ...]
    left_out: tuple[str, ...]


def read_world(path: Path, taken: NameRegister) -> World:
    """Read an .sdf, .world or .urdf file; taken: names of bodies that are given already.

    Raises InvalidValueError. Nothing outside the file's folder is opened.
    """
    try:
        text = read_regular_file(path, BYTES_MAX).decode("utf-8")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise InvalidValueError("the file defines entities: they are not read")
        root = Xml.fromstring(text)
    except (Xml.ParseError, UnicodeDecodeError) as error:
        raise InvalidValueError(f"this is not XML: {shown(str(error), 120)}") from error
    if root.tag not in ("sdf", "robot"):
        raise InvalidValueError(f"the document is {shown(root.tag)}, must be sdf or robot (URDF)")
    reader = _Reader(path.parent, taken)
    try:
        machines = tuple((reader.sdf if root.tag == "sdf" else reader.urdf)(root))
    except (ValueError, KeyError) as error:
        raise InvalidValueError(f"a value is missing or wrong: {error}") from error
    world = root.find("world") if root.tag == "sdf" else root
    name = (world.get("name") if world is not None else None) or path.stem
    return World(_plain(name), machines, tuple(reader.left_out))


class _Reader:
    """One reading."""

    def __init__(self, folder: Path, taken: NameRegister) -> None:
        self._folder = folder
        self._taken = taken
        self._names: set[str] = set()
        self.left_out: list[str] = []

    def sdf(self, root: Xml.Element) -> Iterator[WorldMachine]:
        world = root.find("world")
        for include in (root if world is None else world).findall("include"):
            self.left_out.append(f"include {shown(include.findtext('uri') or '')}: merge it first")
        for model in (root if world is None else world).findall("model"):
            name = _plain(model.get("name") or "model")
            bodies = list[Body]()
            if any(joint.get("type") != "fixed" for joint in model.findall("joint")):
                self.left_out.append(f"model {name}: it has joints that move")
                continue
            for link in model.findall("link"):
                for place in link.findall("collision"):
                    pose = composed(_sdf_pose(link), _sdf_pose(place))
                    bodies += self._bodies(name, place, pose)
            if bodies:
                yield WorldMachine(name, _sdf_pose(model), tuple(bodies))

    def urdf(self, root: Xml.Element) -> Iterator[WorldMachine]:
        above = {}
        for joint in root.findall("joint"):
            parent = joint.find("parent")
            child = joint.find("child")
            if parent is None or child is None:
                raise ValueError(
                    f"joint {shown(joint.get('name') or '')} has no parent or no child"
                )
            above[child.get("link") or ""] = (parent.get("link") or "", joint)
        for link in root.findall("link"):
            name = link.get("name") or "link"
            pose = np.eye(4)
            at = link.get("name") or "link"
            moving = False
            seen = set[str]()
            while at in above and at not in seen:
                seen.add(at)
                at, joint = above[at]
                moving |= joint.get("type") != "fixed"
                pose = composed(_urdf_pose(joint), pose)
            if moving or at in above:
                self.left_out.append(
                    f"link {_plain(name)}: a joint above it moves, or there is no root"
                )
                continue
            places = link.findall("collision")
            bodies = [each for p in places for each in self._bodies(_plain(name), p, _urdf_pose(p))]
            if bodies:
                yield WorldMachine(_plain(name), pose, tuple(bodies))

    def _bodies(self, machine: str, place: Xml.Element, pose: FloatArray) -> list[Body]:
        geometry = place.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
        name = self._name(machine, place.get("name") or "body")
        if len(self._names) > BODIES_MAX:
            raise InvalidValueError(f"there are more than {BODIES_MAX} bodies")
        if shape is None or shape.tag not in ("box", "cylinder", "sphere", "capsule", "mesh"):
            self.left_out.append(
                f"{name}: its shape is {'none' if shape is None else shown(shape.tag)}"
            )
            return []
        if shape.tag == "mesh":
            vertices = self._mesh(shape)
            names = piece_names(name, len(vertices))
            pairs = zip(names, vertices, strict=True)
            return [Body(piece, "mesh", pose, np.zeros(3), each) for piece, each in pairs]
        size = np.zeros(3)
        if shape.tag == "box":
            size[:] = _row(_value(shape, "size"), 3)
        else:
            size[0] = float(_value(shape, "radius"))
            size[1] = 0.0 if shape.tag == "sphere" else float(_value(shape, "length"))
        return [Body(name, shape.tag, pose, size)]  # type: ignore[arg-type]

    def _mesh(self, shape: Xml.Element) -> tuple[FloatArray, ...]:
        """A convex mesh as it is, another one in pieces; both formats are in metres."""
        file = _value(shape, "uri" if shape.find("uri") is not None else "filename")
        given = shape.get("scale") or shape.findtext("scale") or "1 1 1"
        triangles = read_solid(self._folder, file).triangles * _row(given, 3)
        points = np.unique(triangles.reshape(-1, 3), axis=0)
        hull = ConvexHull(points)
        volume = float(np.linalg.det(triangles).sum()) / 6.0
        if is_closed(triangles) and volume >= (1.0 - _CONVEX) * hull.volume:
            return (points[np.sort(hull.vertices)],)
        return pieces_of(triangles, PIECES).vertices

    def _name(self, machine: str, name: str) -> str:
        """A name that no other body has."""
        plain = _plain(name)
        wanted = [
            plain,
            f"{machine}_{plain}",
            *(f"{machine}_{plain}_{k}" for k in range(2, BODIES_MAX)),
        ]
        for each in wanted:
            if each not in self._names:
                try:
                    self._taken.add(each)
                except InvalidValueError:
                    continue
                self._names.add(each)
                return each
        raise InvalidValueError(f"there are too many bodies called {plain}")


def _plain(name: str) -> str:
    """The name as a cell's names are: letters first, then also digits and _ . -"""
    text = _NO_NAME.sub("_", name).lstrip("0123456789_.-")
    return text[:50] or "body"


def _value(shape: Xml.Element, key: str) -> str:
    value = shape.get(key) or shape.findtext(key)
    if value is None:
        raise ValueError(f"{shape.tag} has no {key}")
    return value.strip()


def _row(text: str, count: int) -> FloatArray:
    values = np.array([float(word) for word in text.split()])
    if values.shape != (count,) or not np.isfinite(values).all():
        raise ValueError(f"{shown(text)} must be {count} numbers")
    return values


def _sdf_pose(element: Xml.Element) -> FloatArray:
    """The pose (4, 4) of an element in its parent."""
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    if pose.get("relative_to") or pose.get("rotation_format", "euler_rpy") != "euler_rpy":
        raise ValueError(
            "poses relative to other frames, or as quaternions, are not read: write them out"
        )
    values = _row(pose.text or "", 6)
    angles = values[3:] if pose.get("degrees") == "true" else np.degrees(values[3:])
    return pose_of(values[:3], rotation_from_abc(angles[::-1]))


def _urdf_pose(element: Xml.Element) -> FloatArray:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    angles = np.degrees(_row(origin.get("rpy") or "0 0 0", 3))
    return pose_of(_row(origin.get("xyz") or "0 0 0", 3), rotation_from_abc(angles[::-1]))
