"""Triangles of Collada files (.dae), in metres by their <unit>, without another package.

The axis that a file calls up is not turned: URDF and SDF readers take the coordinates as they are,
and the file that names the mesh says how it stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from xml.etree import ElementTree as Xml

import numpy as np

from ir_description.files.stl_mesh import READ_MAX, TRIANGLES_MAX
from ir_values.arrays import FloatArray, IntArray
from ir_values.errors import InvalidValueError, listed, shown

_FACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
_DEPTH = 50  # of nodes in nodes
_COUNT = 100_000  # of instances


def triangles_from_collada(content: bytes) -> FloatArray:
    """Triangles (T, 3, 3) [m] of all geometries as the scene places them. Raises
    InvalidValueError.
    """
    try:
        text = content.decode("utf-8-sig")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise InvalidValueError("the file defines entities: they are not read")
        root = Xml.fromstring(text.lstrip())  # blank lines above a declaration happen
    except (Xml.ParseError, UnicodeDecodeError) as error:
        raise InvalidValueError(f"this is not XML: {shown(str(error), 120)}") from error
    for element in root.iter():  # namespaces say the version only
        element.tag = element.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise InvalidValueError(f"the document is {shown(root.tag)}, must be COLLADA")
    try:
        return _Document(root).triangles()
    except (ValueError, IndexError, KeyError) as error:
        if isinstance(error, InvalidValueError):
            raise
        raise InvalidValueError(
            f"the Collada file has a value that is missing or wrong: {error}"
        ) from error


class _Document:
    """One file."""

    def __init__(self, root: Xml.Element) -> None:
        self._root = root
        self._by_id = {e.get("id"): e for e in root.iter() if e.get("id")}
        self._meshes: dict[str, FloatArray] = {}
        self._placed = 0
        self._total = 0  # triangles
        unit = root.find("asset/unit")
        self._metre = float(unit.get("meter", "1")) if unit is not None else 1.0
        if not 0.0 < self._metre < 1e6:
            raise InvalidValueError(f"its <unit> is {self._metre:g} m, must be above 0")

    def triangles(self) -> FloatArray:
        instance = self._root.find("scene/instance_visual_scene")
        if instance is not None:
            scene = self._named(instance)
            found = [
                each for node in scene.findall("node") for each in self._node(node, np.eye(4), 0)
            ]
        else:
            found = [self._mesh(g) for g in self._root.findall("library_geometries/geometry")]
        triangles = np.concatenate(found) if found else np.zeros((0, 3, 3))
        if not len(triangles):
            raise InvalidValueError("the Collada file has no faces")
        return triangles * self._metre

    def _named(self, instance: Xml.Element) -> Xml.Element:
        url = instance.get("url", "")
        element = self._by_id.get(url.removeprefix("#")) if url.startswith("#") else None
        if element is None:
            raise InvalidValueError(f"the Collada file names {shown(url)}, which it does not have")
        return element

    def _node(self, node: Xml.Element, pose: FloatArray, depth: int) -> Iterator[FloatArray]:
        self._placed += 1
        if depth > _DEPTH or self._placed > _COUNT:
            raise InvalidValueError("the Collada file has too many nodes in nodes")
        for element in node:
            if element.tag in _STEPS:
                pose = pose @ _STEPS[element.tag](_numbers(element))
                if not np.isfinite(pose).all():
                    raise InvalidValueError(
                        f"a <{element.tag}> of the Collada file leads to poses that are not finite"
                    )
            elif element.tag in _REFUSED:
                raise InvalidValueError(f"the Collada file has {_REFUSED[element.tag]}")
            elif element.tag == "instance_geometry":
                yield self._instance(element, pose)
            elif element.tag in ("node", "instance_node"):
                inner = element if element.tag == "node" else self._named(element)
                yield from self._node(inner, pose, depth + 1)

    def _instance(self, element: Xml.Element, pose: FloatArray) -> FloatArray:
        """Triangles (T, 3, 3) of a geometry at a pose (4, 4)."""
        points = self._mesh(self._named(element))
        self._total += len(points)
        if self._total > READ_MAX:
            raise InvalidValueError(f"its instances have more than {READ_MAX} triangles")
        return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])

    def _mesh(self, geometry: Xml.Element) -> FloatArray:
        name = geometry.get("id", "")
        if name not in self._meshes:
            mesh = geometry.find("mesh")
            if mesh is None:
                raise InvalidValueError(f"the geometry {shown(name)} is no <mesh>")
            found = [self._faces(each) for each in mesh if each.tag in _FACES]
            self._meshes[name] = np.concatenate(found) if found else np.zeros((0, 3, 3))
        return self._meshes[name]

    def _faces(self, faces: Xml.Element) -> FloatArray:
        """Triangles (T, 3, 3) of one element of faces: lists, strips or fans of corners, each of
        which is a row of `stride` numbers, one of them its place.
        """
        inputs = faces.findall("input")
        stride = max(int(each.get("offset", "0")) for each in inputs) + 1
        own = next(each for each in inputs if each.get("semantic") == "VERTEX")
        points = self._positions(_source(own, self._by_id))
        offset = int(own.get("offset", "0"))
        corners = []
        for element in faces.iter("p"):
            row = np.array((element.text or "").split(), dtype=np.int64)
            corners.append(row.reshape(-1, stride)[:, offset])
        if faces.tag == "triangles":
            index = np.concatenate(corners).reshape(-1, 3) if corners else np.zeros((0, 3), int)
        elif faces.tag == "polylist":
            counts = np.array((faces.findtext("vcount") or "").split(), dtype=np.int64)
            if counts.sum() != sum(map(len, corners)):
                raise InvalidValueError("a <polylist> has another number of corners than it says")
            first_of_next = np.cumsum(counts)[:-1]
            index = _fans(np.split(np.concatenate(corners), first_of_next))
        elif faces.tag == "tristrips":
            strips = [np.stack([c[:-2], c[1:-1], c[2:]], axis=1) for c in corners]
            index = np.concatenate(strips)
        else:
            index = _fans(corners)
        if len(index) > TRIANGLES_MAX:
            raise InvalidValueError(
                f"it has {len(index)} triangles, must have at most {TRIANGLES_MAX}"
            )
        if len(index) and (index.min() < 0 or index.max() >= len(points)):
            raise InvalidValueError(f"a face names corner {index.max()} of {len(points)}")
        return np.asarray(points[index])

    def _positions(self, vertices: Xml.Element) -> FloatArray:
        own = next(e for e in vertices.findall("input") if e.get("semantic") == "POSITION")
        source = _source(own, self._by_id)
        accessor = source.find("technique_common/accessor")
        array = source.find("float_array")
        if accessor is None or array is None:
            raise InvalidValueError("the corners of a mesh have no accessor")
        stride = int(accessor.get("stride", "1"))
        count = int(accessor.get("count", "0"))
        first = int(accessor.get("offset", "0"))
        names = [each.get("name") or "" for each in accessor.findall("param")]
        if any(names) and names[:3] != ["X", "Y", "Z"]:
            raise InvalidValueError(f"the corners of a mesh are {listed(names)}, must be X, Y, Z")
        values = _numbers(array)
        if stride < 3 or len(values) < first + count * stride:
            raise InvalidValueError("the corners of a mesh are fewer than its accessor says")
        return np.asarray(values[first : first + count * stride].reshape(count, stride)[:, :3])


def _source(own: Xml.Element, known: Mapping[str | None, Xml.Element]) -> Xml.Element:
    return known[own.get("source", "").removeprefix("#")]


def _fans(polygons: Sequence[IntArray]) -> IntArray:
    """Triangles of polygons: each as a fan around its first corner."""
    found = [
        (polygon[0], polygon[k], polygon[k + 1])
        for polygon in polygons
        for k in range(1, len(polygon) - 1)
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def _numbers(element: Xml.Element) -> FloatArray:
    values = np.array((element.text or "").split(), dtype=np.float64)
    if not np.isfinite(values).all():
        raise InvalidValueError(f"a <{element.tag}> of the Collada file is not finite")
    return values


def _matrix(values: FloatArray) -> FloatArray:
    matrix = values.reshape(4, 4)
    if (matrix[3] != [0.0, 0.0, 0.0, 1.0]).any():
        raise InvalidValueError(f"a <matrix> of the Collada file ends with {matrix[3].tolist()}")
    return matrix


def _translation(values: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = values
    return pose


def _scaling(values: FloatArray) -> FloatArray:
    return np.diag([*values, 1.0])


def _rotation(values: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(values[:3]))
    if not length > 0.0:
        raise InvalidValueError("a <rotate> of the Collada file has an axis without length")
    x, y, z = values[:3] / length
    angle = np.radians(values[3])
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] += np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)
    return pose


_STEPS = {"matrix": _matrix, "translate": _translation, "scale": _scaling, "rotate": _rotation}
_REFUSED = {
    "skew": "a <skew>: write it as a <matrix>",
    "lookat": "a <lookat>: write it as a <matrix>",
    "instance_controller": "a skin (instance_controller)",
}
