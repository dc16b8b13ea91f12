"""The six axes of a URDF, in frames parallel to the base at q = 0 and a flange whose x points out.

Fixed joints disappear: what they carry belongs to the link that carries them. A tool frame (tool0,
flange) says where the flange is and how it is turned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from xml.etree import ElementTree as Xml

import numpy as np

from ir_description.files.robot_file import inertia_matrix
from ir_description.poses import rotation_from_abc
from ir_description.robot import TOOL0
from ir_values.arrays import FloatArray
from ir_values.errors import RobotFileError, listed, shown

# The part of URDF that says how an arm is built: links with masses and shapes, joints with limits.

MOVING = ("revolute", "continuous")
EXACT = 2e-5
"""Entries of a rotation miss 0 or 1 by so much where angles were written with five digits."""


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


AXES = 6
TIPS = ("flange", "tool0")
_ON_AXIS = 1e-6  # m: by which a flange may lie beside axis 6


@dataclass(frozen=True, eq=False)
class UrdfArm:
    """joints: the moving ones; origin (6, 3) [m] of each in the frame of the link before, axis (6,
    3) in its own; flange (3, 3): the last frame in the base at q = 0. links: 7, in these frames.
    """

    name: str
    joints: tuple[UrdfJoint, ...]
    origin: FloatArray
    axis: FloatArray
    flange: FloatArray
    links: tuple[UrdfLink, ...]


def urdf_arm(text: str, source: str, tip: str = "") -> UrdfArm:
    """The arm from the base to a link `tip` ("": flange, tool0 or the link that ends the longest
    chain).

    Raises RobotFileError where it has not six turning axes.
    """
    tree = urdf_tree(text, source)
    path = _path(tree, _tip(tree, tip, source))
    moving = [joint for joint in path if joint.kind != "fixed"]
    for joint in moving:
        if joint.kind not in MOVING:
            raise RobotFileError(
                source, 0, f"joint {joint.name} is {joint.kind}: only turning axes are planned"
            )
    if len(moving) != AXES:
        names = listed(joint.name for joint in moving)
        raise RobotFileError(
            source,
            0,
            f"the arm has {len(moving)} axes ({names}): arms of six axes are planned; see --tip",
        )
    placed = _placed(path)
    frames = _frames(path, moving, placed)
    links = [
        _gathered(tree, joint.child if joint else path[0].parent, frame, placed, source)
        for joint, frame in zip([None, *moving], frames, strict=True)
    ]
    origin = np.array([b[:3, 3] - a[:3, 3] for a, b in pairwise(frames)])
    axis = np.array(
        [
            frame[:3, :3].T @ placed[joint.child][:3, :3] @ joint.axis
            for joint, frame in zip(moving, frames[1:], strict=True)
        ]
    )
    return UrdfArm(
        tree.name, tuple(moving), origin, _snapped(axis), frames[-1][:3, :3], tuple(links)
    )


def _tip(tree: UrdfTree, tip: str, source: str) -> str:
    if tip and tip not in tree.links:
        raise RobotFileError(
            source, 0, f"link {shown(tip)} is unknown; known are {listed(tree.links)}"
        )
    known = [name for suffix in TIPS for name in tree.links if name.endswith(suffix)]
    return tip or (known[0] if known else max(tree.links, key=lambda name: len(_path(tree, name))))


def _path(tree: UrdfTree, tip: str) -> list[UrdfJoint]:
    """The joints from the base to a link; a first link called world is not the base."""
    path: list[UrdfJoint] = []
    while tip in tree.above and len(path) <= len(tree.links):
        path.insert(0, tree.above[tip])
        tip = path[0].parent
    if path and path[0].kind == "fixed" and path[0].parent == "world":
        path = path[1:]
    return path


def _placed(path: list[UrdfJoint]) -> dict[str, FloatArray]:
    """Pose (4, 4) in the base at q = 0 of every link along the path."""
    placed = {path[0].parent: np.eye(4)}
    for joint in path:
        placed[joint.child] = placed[joint.parent] @ joint.pose
    return placed


def _frames(
    path: list[UrdfJoint], moving: list[UrdfJoint], placed: dict[str, FloatArray]
) -> list[FloatArray]:
    """Poses (4, 4) of the 7 frames in the base: where the joints are, the last where the flange
    is.
    """
    frames = [np.eye(4)]
    for joint in moving:
        frame = np.eye(4)
        frame[:3, 3] = placed[joint.child][:3, 3]
        frames.append(frame)
    tip = placed[path[-1].child]
    last = placed[moving[-1].child]
    z = last[:3, :3] @ moving[-1].axis
    frames[-1][:3, 3] = last[:3, 3] + ((tip[:3, 3] - last[:3, 3]) @ z) * z
    R = _snapped(tip[:3, :3] @ TOOL0[:3, :3].T if path[-1].child.endswith("tool0") else tip[:3, :3])
    if abs(abs(R[:, 0] @ z) - 1.0) > EXACT:  # not a flange by its x: build one
        out = z if (tip[:3, 3] - last[:3, 3]) @ z >= 0.0 else -z
        helper = np.eye(3)[2] if abs(out[2]) < 0.9 else np.eye(3)[1]
        y = np.cross(helper, out) / np.linalg.norm(np.cross(helper, out))
        R = _snapped(np.stack([out, y, np.cross(out, y)], axis=1))
    frames[-1][:3, :3] = R
    return frames


def _snapped(values: FloatArray) -> FloatArray:
    """Entries that miss -1, 0 or 1 by rounding are these."""
    near = np.round(values)
    return np.asarray(np.where(np.abs(values - near) < EXACT, near, values))


def _gathered(
    tree: UrdfTree, name: str, frame: FloatArray, placed: dict[str, FloatArray], source: str
) -> UrdfLink:
    """A link with everything that is fixed to it, in its frame (4, 4 in the base at q = 0)."""
    pose = placed[name]
    parts = list(_fixed(tree, name, np.linalg.inv(frame) @ pose))
    mass = sum(part.mass for part in parts)
    if not mass > 0.0:
        raise RobotFileError(source, 0, f"link {name} has no mass: give it an <inertial>")
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        inertia += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return UrdfLink(
        name, mass, com, inertia, tuple(shape for part in parts for shape in part.shapes)
    )


def _fixed(tree: UrdfTree, name: str, pose: FloatArray) -> list[UrdfLink]:
    """A link and those fixed to it, moved by the pose (4, 4) of the link."""
    link = tree.links[name]
    R = pose[:3, :3]
    shapes = tuple(_moved(shape, pose) for shape in link.shapes)
    own = replace(
        link, com=R @ link.com + pose[:3, 3], inertia=R @ link.inertia @ R.T, shapes=shapes
    )
    below = [
        joint for joint in tree.above.values() if joint.parent == name and joint.kind == "fixed"
    ]
    return [
        own,
        *(part for joint in below for part in _fixed(tree, joint.child, pose @ joint.pose)),
    ]


def _moved(shape: UrdfShape, pose: FloatArray) -> UrdfShape:
    return replace(shape, pose=pose @ shape.pose)
