"""The robot as URDF: links from the robot data, shapes from its capsules, loads fixed to the
flange.

Frames: cell (the root, where the base's pose is given), base_link, link_1 .. link_n, flange (the
last link's frame), tool0 (at the flange, z out), tcp. The root has no inertia, as KDL wants it. A
capsule is a cylinder with a sphere at each end, because URDF has no capsules. Friction, rotor
inertia and the counterbalance are not part of it: they belong to the drives.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree as Xml

import numpy as np

from ir_description.poses import abc_from_rotation
from ir_description.robot import Load, RobotModel
from ir_description.shapes import Capsule
from ir_kernels import portable
from ir_msgs_py.names import WORLD_FRAME
from ir_values.arrays import FloatArray

FRAME_MASS = 1e-9
"""Mass [kg] of a link that is only a frame: some simulators take a missing mass for 1 kg."""
_FRAME_INERTIA = np.eye(3) * 1e-12
_TOOL0 = (0.0, math.pi / 2.0, 0.0)
_COLOURS = {"link": "1.0 0.45 0.1 1.0", "load": "0.35 0.4 0.45 1.0"}


def robot_urdf(
    robot: RobotModel,
    load: Load | Sequence[Load] | None = None,
    tcp: FloatArray | None = None,
    base_pose: FloatArray | None = None,
) -> str:
    """Return the URDF text of the robot with its load(s) and the tcp (4, 4) in the last link's
    frame.

    Each load is a link `load_<name>` fixed to the flange. Without a tcp it stands at the flange.
    With the base's pose (4, 4) in the cell, the root is the frame `cell`.
    """
    loads: tuple[Load, ...] = ()
    if isinstance(load, Load):
        loads = (load,)
    elif load is not None:
        loads = tuple(load)
    here = (0.0, 0.0, 0.0)
    root = Xml.Element("robot", name=robot.name)
    for name, colour in _COLOURS.items():
        material = Xml.SubElement(root, "material", name=name)
        Xml.SubElement(material, "color", rgba=colour)
    if base_pose is not None:
        Xml.SubElement(root, "link", name=WORLD_FRAME)
        base = robot.link_names[0]
        turned = _rpy(base_pose[:3, :3])
        _fixed(root, child=base, parent=WORLD_FRAME, xyz=base_pose[:3, 3], rpy=turned)
    for i, name in enumerate(robot.link_names):
        _link(
            root,
            name,
            mass=float(robot.link_mass[i]),
            com=robot.link_com[i],
            inertia=robot.link_inertia[i],
            capsules=[capsule for capsule in robot.capsules if capsule.link == i],
            material="link",
        )
    for i in range(robot.n):
        _joint(root, robot, i)
    last = robot.link_names[-1]
    _frame(root, "flange", parent=last, xyz=here, rpy=here)
    _frame(root, "tool0", parent="flange", xyz=here, rpy=_TOOL0)
    pose = np.eye(4) if tcp is None else tcp
    _frame(root, "tcp", parent="flange", xyz=pose[:3, 3], rpy=_rpy(pose[:3, :3]))
    for item in loads:
        name = f"load_{item.name}"
        _link(root, name, item.mass, item.com, item.inertia, item.capsules, material="load")
        _fixed(root, child=name, parent="flange", xyz=here, rpy=here)
    Xml.indent(root)
    return '<?xml version="1.0"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _link(
    root: Xml.Element,
    name: str,
    mass: float,
    com: FloatArray,
    inertia: FloatArray,
    capsules: Iterable[Capsule],
    material: str,
) -> None:
    link = Xml.SubElement(root, "link", name=name)
    inertial = Xml.SubElement(link, "inertial")
    _origin(inertial, com, (0.0, 0.0, 0.0))
    Xml.SubElement(inertial, "mass", value=repr(mass))
    entries = {
        "ixx": (0, 0),
        "ixy": (0, 1),
        "ixz": (0, 2),
        "iyy": (1, 1),
        "iyz": (1, 2),
        "izz": (2, 2),
    }
    Xml.SubElement(
        inertial, "inertia", {key: repr(float(inertia[ij])) for key, ij in entries.items()}
    )
    for capsule in capsules:
        for kind in ("visual", "collision"):
            _capsule(link, kind, capsule, material)


def _capsule(link: Xml.Element, kind: str, capsule: Capsule, material: str) -> None:
    """Add a capsule as two spheres and the cylinder between them: URDF has no capsule."""
    axis = capsule.p1 - capsule.p0
    length = float(portable.norm(axis))
    ends = (capsule.p0, capsule.p1) if length > 0.0 else (capsule.p0,)
    for i, end in enumerate(ends):
        name = f"{capsule.name}_end_{i}"
        sphere = _shape(link, kind, name, xyz=end, rpy=(0.0, 0.0, 0.0), material=material)
        Xml.SubElement(sphere, "sphere", radius=repr(capsule.radius))
    if length > 0.0:
        x, y, z = axis / length
        rpy = (0.0, math.acos(min(1.0, max(-1.0, z))), math.atan2(y, x))
        middle = (capsule.p0 + capsule.p1) / 2.0
        between = _shape(link, kind, capsule.name, xyz=middle, rpy=rpy, material=material)
        Xml.SubElement(between, "cylinder", radius=repr(capsule.radius), length=repr(length))


def _shape(
    link: Xml.Element, kind: str, name: str, xyz: FloatArray, rpy: Sequence[float], material: str
) -> Xml.Element:
    shape = Xml.SubElement(link, kind, name=name)
    _origin(shape, xyz, rpy)
    geometry = Xml.SubElement(shape, "geometry")
    if kind == "visual":
        Xml.SubElement(shape, "material", name=material)
    return geometry


def _joint(root: Xml.Element, robot: RobotModel, i: int) -> None:
    kind = "prismatic" if i < robot.base else "revolute"
    joint = Xml.SubElement(root, "joint", name=robot.joint_names[i], type=kind)
    origin = robot.joint_origin[i]
    _origin(joint, origin[:3, 3], _rpy(origin[:3, :3]))
    Xml.SubElement(joint, "parent", link=robot.link_names[i])
    Xml.SubElement(joint, "child", link=robot.link_names[i + 1])
    Xml.SubElement(joint, "axis", xyz=_numbers_text(robot.joint_axis[i]))
    Xml.SubElement(
        joint,
        "limit",
        lower=repr(float(robot.position_min[i])),
        upper=repr(float(robot.position_max[i])),
        velocity=repr(float(robot.velocity_max[i])),
        effort=repr(float(robot.envelope_torque[i, 0])),
    )
    Xml.SubElement(joint, "dynamics", damping="0.0", friction="0.0")


def _frame(
    root: Xml.Element,
    name: str,
    parent: str,
    xyz: Sequence[float] | FloatArray,
    rpy: Sequence[float],
) -> None:
    _link(root, name, FRAME_MASS, np.zeros(3), _FRAME_INERTIA, (), "link")
    _fixed(root, name, parent, xyz, rpy)


def _fixed(
    root: Xml.Element,
    child: str,
    parent: str,
    xyz: Sequence[float] | FloatArray,
    rpy: Sequence[float],
) -> None:
    joint = Xml.SubElement(root, "joint", name=f"{child}_joint", type="fixed")
    _origin(joint, xyz, rpy)
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)


def _origin(element: Xml.Element, xyz: Sequence[float] | FloatArray, rpy: Sequence[float]) -> None:
    Xml.SubElement(element, "origin", xyz=_numbers_text(xyz), rpy=_numbers_text(rpy))


def _numbers_text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)


def _rpy(R: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch, yaw [rad]: KUKA's C, B, A."""
    yaw, pitch, roll = np.radians(abc_from_rotation(R))
    return float(roll), float(pitch), float(yaw)
