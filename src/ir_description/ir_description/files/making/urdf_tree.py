"""The part of URDF that says how an arm is built: links with masses and shapes, joints with
limits.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as Xml

import numpy as np

from ir_description.errors import RobotFileError, listed, shown
from ir_description.files.robot_file import inertia_matrix
from ir_description.poses import rotation_from_abc
from ir_msgs_py.arrays import FloatArray

MOVING = ("revolute", "continuous")
EXACT = (
    2e-5  # by which entries of a rotation miss 0 or 1 where angles were written with five digits
)


@dataclass(frozen=True, eq=False)
class UrdfShape:
    """A collision shape: kind ("mesh", "box", "cylinder", "sphere"), its pose (4, 4) in its link,
    size (3,) [m] (box: edges; cylinder: radius, length; mesh: scale), and the file of a mesh.
    """

    kind: str
    pose: FloatArray
    size: FloatArray
    file: str = ""


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """mass [kg] (0: none is given), com (3,) [m], inertia (3, 3) [kg m^2] about it, in the link's
    frame.
    """

    name: str
    mass: float
    com: FloatArray
    inertia: FloatArray
    shapes: tuple[UrdfShape, ...]


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint, the pose (4, 4) of its frame in the parent link, limits [rad, rad/s, Nm], 0: not
    given.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: FloatArray
    axis: FloatArray
    lower: float
    upper: float
    velocity: float
    effort: float


@dataclass(frozen=True)
class UrdfTree:
    """A robot: its links and joints by name; joints by the link that they carry."""

    name: str
    links: dict[str, UrdfLink]
    above: dict[str, UrdfJoint]


def urdf_tree(text: str, source: str) -> UrdfTree:
    """Read a URDF. Raises RobotFileError."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise RobotFileError(source, 0, "the URDF defines entities: they are not read")
    if "<xacro:" in text:
        raise RobotFileError(
            source, 0, "this is a xacro file: expand it first (xacro FILE > robot.urdf)"
        )
    try:
        root = Xml.fromstring(text)
    except Xml.ParseError as error:
        raise RobotFileError(source, error.position[0], f"this is not XML: {error}") from error
    if root.tag != "robot":
        raise RobotFileError(source, 0, f"the document is {shown(root.tag)}, must be 'robot'")
    try:
        links = {link.name: link for link in map(_link, root.findall("link"))}
        joints = [_joint(element) for element in root.findall("joint")]
    except (ValueError, KeyError) as error:
        raise RobotFileError(source, 0, f"a value is missing or no number: {error}") from error
    for joint in joints:
        for name in (joint.parent, joint.child):
            if name not in links:
                raise RobotFileError(
                    source, 0, f"joint {joint.name} names the link {shown(name)}: {listed(links)}"
                )
    return UrdfTree(root.get("name") or "robot", links, {joint.child: joint for joint in joints})


def _link(element: Xml.Element) -> UrdfLink:
    name = element.attrib["name"]
    inertial = element.find("inertial")
    shapes = tuple(
        shape for one in element.findall("collision") if (shape := _shape(one)) is not None
    )
    if inertial is None:
        return UrdfLink(name, 0.0, np.zeros(3), np.zeros((3, 3)), shapes)
    pose = _origin(inertial)
    mass = inertial.find("mass")
    inertia = inertial.find("inertia")
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    entries = [float(inertia.get(key, "0")) if inertia is not None else 0.0 for key in keys]
    about = pose[:3, :3] @ inertia_matrix(entries) @ pose[:3, :3].T
    return UrdfLink(
        name, float(mass.attrib["value"]) if mass is not None else 0.0, pose[:3, 3], about, shapes
    )


def _joint(element: Xml.Element) -> UrdfJoint:
    axis = element.find("axis")
    limit = element.find("limit")
    direction = (
        _numbers(axis.get("xyz", "1 0 0")) if axis is not None else np.array([1.0, 0.0, 0.0])
    )
    parent = element.find("parent")
    child = element.find("child")
    if parent is None or child is None:
        raise ValueError(f"joint {element.attrib['name']} has no parent or no child")
    values = [float(limit.get(key, "0")) if limit is not None else 0.0 for key in _LIMITS]
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        raise ValueError(f"the axis of joint {element.attrib['name']} has no length")
    return UrdfJoint(
        element.attrib["name"],
        element.attrib["type"],
        parent.attrib["link"],
        child.attrib["link"],
        _origin(element),
        direction / length,
        *values,
    )


_LIMITS = ("lower", "upper", "velocity", "effort")


def _shape(element: Xml.Element) -> UrdfShape | None:
    geometry = element.find("geometry")
    for one in () if geometry is None else geometry:
        pose = _origin(element)
        if one.tag == "mesh":
            return UrdfShape(
                "mesh", pose, _numbers(one.get("scale", "1 1 1")), one.attrib["filename"]
            )
        if one.tag == "box":
            return UrdfShape("box", pose, _numbers(one.attrib["size"]))
        if one.tag == "cylinder":
            size = np.array([float(one.attrib["radius"]), float(one.attrib["length"]), 0.0])
            return UrdfShape("cylinder", pose, size)
        if one.tag == "sphere":
            return UrdfShape("sphere", pose, np.array([float(one.attrib["radius"]), 0.0, 0.0]))
    return None


def _origin(element: Xml.Element) -> FloatArray:
    """The pose (4, 4) of an element's origin; angles written with few digits are taken as right
    angles.
    """
    pose = np.eye(4)
    origin = element.find("origin")
    if origin is not None:
        roll, pitch, yaw = np.degrees(_numbers(origin.get("rpy", "0 0 0")))
        R = rotation_from_abc((yaw, pitch, roll))
        near = np.round(R)
        pose[:3, :3] = near if np.abs(R - near).max() < EXACT else R
        pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    return pose


def _numbers(text: str) -> FloatArray:
    values = np.array([float(word) for word in text.split()])
    if values.shape != (3,) or not np.isfinite(values).all():
        raise ValueError(f"{shown(text)} must be three finite numbers")
    return values
