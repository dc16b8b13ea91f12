"""The machines of a cell as a world of SDF or URDF: poses, primitives, and hulls as OBJ files
beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree as Xml

import numpy as np
from scipy.spatial import ConvexHull

from ir_description.cell import Cell, Equipment
from ir_description.poses import abc_from_rotation
from ir_description.shapes import Body
from ir_msgs_py.arrays import FloatArray

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
