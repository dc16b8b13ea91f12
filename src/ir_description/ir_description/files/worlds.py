"""Worlds in SDF, URDF or MoveIt's .scene: the machines of one are read, those of a cell are
written.

Read are static models and links, their collision shapes, the meshes beside the file, and the models
below its folder that it includes. What can't be read is left out and named.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ir_description.cell import Cell, Equipment, NameRegister
from ir_description.files.moveit_scene import SceneObject, scene_objects
from ir_description.files.piece_cache import pieces_of
from ir_description.files.sdf_frames import Frames
from ir_description.files.solid_mesh import SUFFIXES, read_solid
from ir_description.files.solid_reader import PIECES, piece_names
from ir_description.files.stl_mesh import is_closed
from ir_description.poses import abc_from_rotation, composed, inverse, pose_of, rotation_from_abc
from ir_description.shapes import Body
from ir_values.arrays import FloatArray, number_of
from ir_values.errors import DescriptionError, InvalidValueError, shown
from ir_values.extensions import Registry
from ir_values.files import read_regular_file

BYTES_MAX = 8_000_000
BODIES_MAX = 10_000
FARTHEST = 1e4
"""m from the world's origin that a body may stand."""
_NO_NAME = re.compile(r"[^A-Za-z0-9_.-]+")
_DEPTH = 20  # of models in models
_MOVING = ("actor", "population", "road")  # what has bodies, and is not read
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


def read_world(path: Path, taken: NameRegister, *, visuals: bool = False) -> World:
    """Read an .sdf, .world, .urdf or .scene file; taken: names of bodies that are given already;
    visuals: whether links without a collision shape take what people see of them.

    Raises InvalidValueError, also where no body can be read. Nothing outside the file's folder is
    opened. Other endings are read by installed packages.
    """
    if path.suffix.lower().removeprefix(".") in IMPORTERS:
        return _imported(path)
    try:
        text = read_regular_file(path, BYTES_MAX).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InvalidValueError(f"this is no text: {shown(str(error), 120)}") from error
    reader = _WorldReader(path.parent, taken, visuals)
    try:
        if path.suffix.lower() == ".scene":
            name, objects = scene_objects(text)
            machines = tuple(reader.scene(objects))
        else:
            root = _document(text)
            machines = tuple((reader.sdf if root.tag == "sdf" else reader.urdf)(root))
            world = root.find("world") if root.tag == "sdf" else root
            name = (world.get("name") if world is not None else None) or path.stem
    except (ValueError, KeyError) as error:
        raise InvalidValueError(f"a value is missing or wrong: {error}") from error
    if not machines:
        said = "; ".join(reader.left_out) or "it has none"
        raise InvalidValueError(f"no body of the world can be read: {said}")
    _check_places(machines)
    return World(_plain(name), machines, tuple(reader.left_out))


def _check_places(machines: Iterable[WorldMachine]) -> None:
    """Raise InvalidValueError where a body stands so far away that its unit is hardly meant."""
    for machine in machines:
        for body in machine.bodies:
            far = float(np.abs(machine.pose[:3] @ body.pose[:, 3]).max())
            if not far <= FARTHEST:
                raise InvalidValueError(
                    f"{body.name} of {machine.name} stands {far:g} m away, must be within "
                    f"{FARTHEST:g} m: metres are meant"
                )


def _made_importer(name: str, value: Any) -> Callable[[Path], World]:
    """The function of an entry point."""
    if not callable(value):
        raise InvalidValueError("must be a function of a path that returns a World")
    read: Callable[[Path], World] = value
    return read


IMPORTERS: Registry[Callable[[Path], World]] = Registry(
    "ir_description.worlds", {}, _made_importer, reserved=("sdf", "world", "urdf", "scene")
)
"""Readers of installed packages, by the ending of the files that they read, without its dot."""


def _imported(path: Path) -> World:
    """The world by an installed package. Raises InvalidValueError."""
    ending = path.suffix.lower().removeprefix(".")
    try:
        world = IMPORTERS[ending](path)
    except DescriptionError as error:
        raise InvalidValueError(str(error)) from error
    if not world.machines:
        raise InvalidValueError(f"{IMPORTERS.origin(ending)} reads no machine from it")
    return world


def _document(text: str) -> Xml.Element:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InvalidValueError("the file defines entities: they are not read")
    try:
        root = Xml.fromstring(text.lstrip())  # blank lines above a declaration happen
    except Xml.ParseError as error:
        raise InvalidValueError(f"this is not XML: {shown(str(error), 120)}") from error
    if root.tag not in ("sdf", "robot"):
        raise InvalidValueError(f"the document is {shown(root.tag)}, must be sdf or robot (URDF)")
    return root


class _WorldReader:
    """One reading."""

    def __init__(self, folder: Path, taken: NameRegister, visuals: bool) -> None:
        self._folder = folder
        self._models = folder
        self._visuals = visuals
        self._taken = taken
        self._names: set[str] = set()
        self._count = 0  # of models
        self._within: tuple[Path, ...] = ()  # the included files in which the reader is
        self.left_out: list[str] = []

    def sdf(self, root: Xml.Element) -> Iterator[WorldMachine]:
        worlds = root.findall("world")
        scope = worlds[0] if worlds else root
        for other in worlds[1:]:
            self._leave_out(f"world {other.get('name') or ''}", other, "a file's first is read")
        for model in root.findall("model") if worlds else ():
            self._leave_out(f"model {model.get('name') or ''}", model, "it is beside the world")
        yield from self._sdf_models(scope, np.eye(4), 0)

    def _leave_out(self, what: str, element: Xml.Element, why: str) -> None:
        """Name an element that is not read, and how many bodies it has."""
        count = sum(1 for _ in element.iter("collision"))
        shapes = f", and {count} collision shapes with it" if count else ""
        self.left_out.append(f"{what.strip()}: {why}{shapes}")

    def _sdf_models(
        self, parent: Xml.Element, pose: FloatArray, depth: int
    ) -> Iterator[WorldMachine]:
        """Models in a world or a model at a pose (4, 4), included ones among them."""
        frames = Frames(parent)
        for tag in _MOVING:
            for each in parent.findall(tag):
                self._leave_out(f"{tag} {each.get('name') or ''}", each, "its kind is not read")
        for include in parent.findall("include"):
            yield from self._included(include, frames, pose, depth)
        for model in parent.findall("model"):
            yield from self._sdf_model(model, composed(pose, frames.placed(model)), depth)

    def _sdf_model(
        self, model: Xml.Element, pose: FloatArray, depth: int
    ) -> Iterator[WorldMachine]:
        name = _plain(model.get("name") or "model")
        self._count += 1
        if self._count > BODIES_MAX:
            raise InvalidValueError(f"there are more than {BODIES_MAX} models, included ones too")
        if any(joint.get("type") != "fixed" for joint in model.findall("joint")):
            self._leave_out(f"model {name}", model, "it has joints that move")
            return
        bodies = list[Body]()
        frames = Frames(model)
        for link in model.findall("link"):
            stands = frames.placed(link)
            for place in self._places(link, f"link {link.get('name') or ''} of model {name}"):
                bodies += self._bodies(name, place, frames.placed(place, stands))
        if bodies:
            yield WorldMachine(name, pose, tuple(bodies))
        yield from self._sdf_models(model, pose, depth + 1)

    def _included(
        self, include: Xml.Element, frames: Frames, pose: FloatArray, depth: int
    ) -> Iterator[WorldMachine]:
        """The model of a folder below the world's own: model://NAME, or its path; frames: of what
        includes it.
        """
        uri = (include.findtext("uri") or "").strip()
        named = uri.partition("://")[2] if "://" in uri else uri
        folders = [self._folder / named, self._folder / "models" / named]
        found = [
            file
            for folder in folders
            for file in (folder / "model.sdf", folder)
            if file.is_file() and file.resolve().is_relative_to(self._folder.resolve())
        ]
        if not found:
            self.left_out.append(
                f"include {shown(uri)}: there is no {named or 'model'}/model.sdf in the world's "
                "folder or its models/: put it there, or merge it"
            )
            return
        file = found[0].resolve()
        if file in self._within or depth > _DEPTH:
            self.left_out.append(f"include {shown(uri)}: it includes itself")
            return
        text = read_regular_file(file, BYTES_MAX).decode("utf-8", errors="replace")
        outer = self._models, self._within
        self._models, self._within = file.parent, (*self._within, file)
        for model in _document(text).findall("model"):
            given = include.findtext("name")
            if given:
                model.set("name", given.strip())
            placement = include.findtext("placement_frame")
            if placement:
                model.set("placement_frame", placement.strip())
            if include.find("pose") is None:
                at = Frames(Xml.Element("sdf")).placed(model)
            else:
                at = frames.placed(include)
                if model.get("placement_frame"):
                    own = Frames(model).frame(model.get("placement_frame", ""))
                    at = composed(at, inverse(own))
            yield from self._sdf_model(model, composed(pose, at), depth + 1)
        self._models, self._within = outer

    def _places(self, link: Xml.Element, what: str) -> list[Xml.Element]:
        """The collision shapes of a link; of one that has none, its visual ones where asked."""
        places = link.findall("collision")
        seen = link.findall("visual")
        if places or not seen:
            return places
        if self._visuals:
            return seen
        self.left_out.append(
            f"{what}: it has no collision shape, but {len(seen)} visual ones (--visuals takes them)"
        )
        return []

    def scene(self, objects: Iterable[SceneObject]) -> Iterator[WorldMachine]:
        """Objects of a MoveIt scene."""
        for each in objects:
            name = _plain(each.name)
            bodies = list[Body]()
            for shape in each.shapes:
                own = self._name(name, name)
                size = np.zeros(3)
                size[: len(shape.size)] = shape.size[:3]
                if shape.kind == "mesh":
                    bodies += self._pieces(own, shape.triangles, shape.pose)
                elif shape.kind in ("cone", "plane"):
                    self.left_out.append(f"{own}: its shape is {shape.kind}")
                else:
                    bodies.append(Body(own, shape.kind, shape.pose, size))  # type: ignore[arg-type]
            if bodies:
                yield WorldMachine(name, each.pose, tuple(bodies))

    def urdf(self, root: Xml.Element) -> Iterator[WorldMachine]:
        """A machine for each link that stands still in the world, with the poses (4, 4) of all
        joints above it; others are left out with a sentence.
        """
        above = {}
        for joint in root.findall("joint"):
            parent = joint.find("parent")
            child = joint.find("child")
            if parent is None or child is None:
                raise ValueError(
                    f"joint {shown(joint.get('name') or '')} has no parent or no child"
                )
            carried = child.get("link") or ""
            if carried in above:
                raise ValueError(f"link {shown(carried)} is carried by two joints")
            above[carried] = (parent.get("link") or "", joint)
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
            places = self._places(link, f"link {_plain(name)}")
            bodies = [each for p in places for each in self._bodies(_plain(name), p, _urdf_pose(p))]
            if bodies:
                yield WorldMachine(_plain(name), pose, tuple(bodies))

    def _bodies(self, machine: str, place: Xml.Element, pose: FloatArray) -> list[Body]:
        """The bodies of one <collision> or <visual> at a pose (4, 4); what is no shape that is read
        is left out with a sentence.
        """
        geometry = place.find("geometry")
        shapes = [] if geometry is None else list(geometry)
        shape = shapes[0] if shapes else None
        name = self._name(machine, place.get("name") or "body")
        if len(self._names) > BODIES_MAX:
            raise InvalidValueError(f"there are more than {BODIES_MAX} bodies")
        if len(shapes) > 1:
            kinds = ", ".join(shown(each.tag) for each in shapes)
            self.left_out.append(
                f"{name}: its geometry has {len(shapes)} shapes ({kinds}), not one"
            )
            return []
        if shape is None or shape.tag not in ("box", "cylinder", "sphere", "capsule", "mesh"):
            self.left_out.append(
                f"{name}: its shape is {'none' if shape is None else shown(shape.tag)}"
            )
            return []
        if shape.tag == "mesh":
            return self._mesh(name, shape, pose)
        size = np.zeros(3)
        if shape.tag == "box":
            size[:] = _so_many_numbers(_value(shape, "size"), 3)
        else:
            size[0] = number_of(_value(shape, "radius"))
            size[1] = 0.0 if shape.tag == "sphere" else number_of(_value(shape, "length"))
        return [Body(name, shape.tag, pose, size)]  # type: ignore[arg-type]

    def _mesh(self, name: str, shape: Xml.Element, pose: FloatArray) -> list[Body]:
        """A mesh in metres, as it is or in pieces; one that can't be read is left out."""
        file = _value(shape, "uri" if shape.find("uri") is not None else "filename")
        given = shape.get("scale") or shape.findtext("scale") or "1 1 1"
        scale = _so_many_numbers(given, 3)
        if shape.find("submesh") is not None:
            self.left_out.append(
                f"{name}: it is a <submesh> of {shown(file)}: write a file of its own"
            )
            return []
        try:
            triangles = read_solid(*self._place_of(file), (*SUFFIXES, ".dae")).triangles
        except InvalidValueError as error:
            self.left_out.append(f"{name}: {error}")
            return []
        if np.prod(scale) < 0.0:  # a mirrored solid is seen from inside
            triangles = triangles[:, ::-1]
        return self._pieces(name, triangles * scale, pose)

    def _place_of(self, file: str) -> tuple[Path, str]:
        """The folder in which a mesh must lie, and its name there."""
        if file.startswith("model://"):
            name, _, rest = file.removeprefix("model://").partition("/")
            for home in (self._folder / name, self._folder / "models" / name):
                if (home / rest).is_file() or home == self._models:
                    return home, rest
        return self._models, file

    def _pieces(self, name: str, triangles: FloatArray, pose: FloatArray) -> list[Body]:
        """A mesh as bodies; one without a volume is left out."""
        try:
            bodies, note = mesh_bodies(name, triangles, pose)
        except InvalidValueError as error:
            self.left_out.append(str(error))
            return []
        if note:
            self.left_out.append(note)
        return bodies

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


def mesh_bodies(name: str, triangles: FloatArray, pose: FloatArray) -> tuple[list[Body], str]:
    """A convex mesh (T, 3, 3) [m] as it is, another one in pieces, an open one as its hull, with a
    note. Raises InvalidValueError: it has no volume.
    """
    points = np.unique(triangles.reshape(-1, 3), axis=0)
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise InvalidValueError(f"{name}: its mesh spans no volume") from error
    whole = points[np.sort(hull.vertices)]
    volume = float(np.linalg.det(triangles).sum()) / 6.0
    note = ""
    if is_closed(triangles) and volume >= (1.0 - _CONVEX) * hull.volume:
        vertices: tuple[FloatArray, ...] = (whole,)
    else:
        try:
            vertices = pieces_of(triangles, PIECES).vertices
        except InvalidValueError as error:
            note = (
                f"gaps of {name}: it is filled to its convex hull of {hull.volume:.3g} m^3, "
                f"because {error}"
            )
            vertices = (whole,)
    names = piece_names(name, len(vertices))
    bodies = [
        Body(piece, "mesh", pose, np.zeros(3), each)
        for piece, each in zip(names, vertices, strict=True)
    ]
    return bodies, note


def _plain(name: str) -> str:
    """The name as a cell's names are: letters first, then also digits and _ . -"""
    text = _NO_NAME.sub("_", name).lstrip("0123456789_.-")
    return text[:50] or "body"


def _value(shape: Xml.Element, key: str) -> str:
    value = shape.get(key) or shape.findtext(key)
    if value is None:
        raise ValueError(f"{shape.tag} has no {key}")
    return value.strip()


def _so_many_numbers(text: str, count: int) -> FloatArray:
    """So many finite numbers from a text. Raises ValueError."""
    values = np.array([number_of(word) for word in text.split()])
    if values.shape != (count,) or not np.isfinite(values).all():
        raise ValueError(f"{shown(text)} must be {count} numbers")
    return values


def _urdf_pose(element: Xml.Element) -> FloatArray:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    angles = np.degrees(_so_many_numbers(origin.get("rpy") or "0 0 0", 3))
    return pose_of(
        _so_many_numbers(origin.get("xyz") or "0 0 0", 3), rotation_from_abc(angles[::-1])
    )


Files = dict[str, str]
"""Texts by the names of files."""


def world_sdf(cell: Cell) -> tuple[str, Files]:
    """Return the SDF of the machines as they stand, a static model each, and the OBJ files that it
    names.
    """
    root = Xml.Element("sdf", version="1.9")
    world = Xml.SubElement(root, "world", name=cell.name)
    files = Files()
    for machine in _machines(cell):
        model = Xml.SubElement(world, "model", name=machine.name)
        Xml.SubElement(model, "static").text = "true"
        Xml.SubElement(model, "pose").text = _six(machine.pose)
        link = Xml.SubElement(model, "link", name="link")
        for body in machine.present_bodies():
            for kind in ("collision", "visual"):
                place = Xml.SubElement(link, kind, name=body.name)
                Xml.SubElement(place, "pose").text = _six(body.pose)
                _sdf_shape(Xml.SubElement(place, "geometry"), body, files)
    return _text(root), files


def world_urdf(cell: Cell) -> tuple[str, Files]:
    """Return the same as URDF: a root link, and a link fixed to it for each machine."""
    # 1.2 has capsules
    root = Xml.Element("robot", name=cell.name, version="1.2")
    files = Files()
    Xml.SubElement(root, "link", name="world")
    for machine in _machines(cell):
        link = Xml.SubElement(root, "link", name=machine.name)
        for body in machine.present_bodies():
            for kind in ("collision", "visual"):
                place = Xml.SubElement(link, kind, name=body.name)
                _origin(place, body.pose)
                _urdf_shape(Xml.SubElement(place, "geometry"), body, files)
        joint = Xml.SubElement(root, "joint", name=f"world_{machine.name}", type="fixed")
        Xml.SubElement(joint, "parent", link="world")
        Xml.SubElement(joint, "child", link=machine.name)
        _origin(joint, machine.pose)
    return _text(root), files


WRITERS: dict[str, Callable[[Cell], tuple[str, Files]]] = {"sdf": world_sdf, "urdf": world_urdf}


def _machines(cell: Cell) -> list[Equipment]:
    return [machine for machine in cell.equipment if machine.enabled]


def _sdf_shape(geometry: Xml.Element, body: Body, files: Files) -> None:
    shape = Xml.SubElement(geometry, body.kind)
    for key, value in _values(body, files).items():
        Xml.SubElement(shape, "uri" if key == "filename" else key).text = value
    if body.kind == "plane":
        Xml.SubElement(shape, "normal").text = "0 0 1"


def _urdf_shape(geometry: Xml.Element, body: Body, files: Files) -> None:
    if body.kind == "plane":  # URDF has none: a slab as large as a cell may be
        Xml.SubElement(geometry, "box", size="1000 1000 0")
    else:
        Xml.SubElement(geometry, body.kind, _values(body, files))


def _values(body: Body, files: Files) -> dict[str, str]:
    if body.kind == "mesh":
        files[f"{body.name}.obj"] = hull_obj(body.vertices)
        return {"filename": f"{body.name}.obj"}
    if body.kind == "box":
        return {"size": _numbers(body.size)}
    lengths = dict(zip(("radius", "length"), map(_number, body.size), strict=False))
    return {"sphere": {"radius": lengths["radius"]}, "plane": {}}.get(body.kind, lengths)


def hull_obj(vertices: FloatArray) -> str:
    """Return the hull of vertices (V, 3) as OBJ, seen from outside."""
    hull = ConvexHull(vertices)
    faces = []
    for simplex, normal in zip(hull.simplices, hull.equations[:, :3], strict=True):
        a, b, c = vertices[simplex]
        turned = simplex if np.cross(b - a, c - a) @ normal > 0.0 else simplex[[0, 2, 1]]
        faces.append("f " + " ".join(str(k + 1) for k in turned))
    return "\n".join([*(f"v {_numbers(vertex)}" for vertex in vertices), *faces]) + "\n"


def _origin(parent: Xml.Element, pose: FloatArray) -> None:
    x, y, z, *angles = _six(pose).split()
    Xml.SubElement(parent, "origin", xyz=f"{x} {y} {z}", rpy=" ".join(angles))


def _six(pose: FloatArray) -> str:
    """x, y, z [m], roll, pitch, yaw [rad] of a pose (4, 4)."""
    return _numbers([*pose[:3, 3], *np.radians(abc_from_rotation(pose[:3, :3]))[::-1]])


def _numbers(values: FloatArray | list[float]) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    return repr(float(value) + 0.0)


def _text(root: Xml.Element) -> str:
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
