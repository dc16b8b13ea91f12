"""Robots of the public recordings, by figures of their makers and of who recorded them.

Only what torques follow from is here: kinematics, masses, rotors, gears, friction. None is planned
with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ir_description import PowerData, RobotModel, load_robot
from ir_description.robot import DcLink, without_table
from ir_values.arrays import FloatArray

ESTIMATED = 0.08  # share of the peak torque: Coulomb friction, and viscous at full speed
ESTIMATES = frozenset(
    f"drives.{each}"
    for each in (
        "reflected_inertia_kgm2",
        "friction_viscous_nms_rad",
        "friction_coulomb_nm",
        "copper_loss_w_per_nm2",
    )
)
_COPPER = 0.03  # share of the peak power at peak torque
_ROTOR = 1.0 / 3.0  # of the peak torque, at full speed in 0.3 s
# The bus of a light arm: 48 V, with a resistor that takes what comes back at once.
BUS_48_V = DcLink(
    capacitance=5e-3, voltage=48.0, chopper_on=52.0, chopper_off=51.0, brake_resistor=5.0
)


def _turn(axis: int, angle: float) -> FloatArray:
    turn = np.eye(4)
    a = (axis + 1) % 3
    b = (axis + 2) % 3
    turn[a, a] = np.cos(angle)
    turn[b, b] = turn[a, a]
    turn[b, a] = np.sin(angle)
    turn[a, b] = -turn[b, a]
    return turn


def _shift(x: float, y: float, z: float) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def _tensor(entries: Sequence[float]) -> FloatArray:
    """Of xx, yy, zz, xy, yz, xz."""
    xx, yy, zz, xy, yz, xz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


Row = tuple[float, float, float, float]  # of Denavit and Hartenberg: offset, d, a, alpha
Body = tuple[float, Sequence[float], Sequence[float]]  # mass, centre, inertia about it


def _by_dh(
    like: RobotModel, rows: Sequence[Row], bodies: Sequence[Body], base: FloatArray
) -> RobotModel:
    """The robot with these links, bodies given in the frame at the end of each link; frames are
    parallel to the base at 0.
    """
    at = base
    places = []
    axes = []
    masses = []
    centres = []
    inertias = []
    for (offset, d, a, alpha), (mass, centre, inertia) in zip(rows, bodies, strict=True):
        axes.append(at[:3, 2])
        places.append(at[:3, 3])
        at = at @ _turn(2, offset) @ _shift(0.0, 0.0, d) @ _shift(a, 0.0, 0.0) @ _turn(0, alpha)
        masses.append(mass)
        centres.append(at[:3, :3] @ np.asarray(centre) + at[:3, 3] - places[-1])
        inertias.append(at[:3, :3] @ _tensor(inertia) @ at[:3, :3].T)
    origins = np.tile(np.eye(4), (len(rows), 1, 1))
    origins[:, :3, 3] = np.diff([np.zeros(3), *places], axis=0)
    return replace(
        like,
        joint_origin=origins,
        joint_axis=np.array(axes),
        link_mass=np.concatenate([like.link_mass[:1], masses]),
        link_com=np.concatenate([like.link_com[:1], centres]),
        link_inertia=np.concatenate([like.link_inertia[:1], inertias]),
        capsules=(),
        self_pairs=(),
        load_self_capsules=(),
    )


def kr300_r2500() -> RobotModel:
    """KUKA KR 300 R2500 ultra SE: links, rotors and ratios as Weigand and others publish them with
    their recordings (2021); gas spring and friction as the KR 210 R2700 extra's.
    """
    down = _turn(0, np.pi)
    rows = (
        (0.0, -0.675, 0.35, np.pi / 2),
        (0.0, -0.189, 1.15, 0.0),
        (np.pi / 2, 0.189, 0.041, -np.pi / 2),
        (0.0, -1.0, 0.0, np.pi / 2),
        (0.0, 0.0, 0.0, -np.pi / 2),
        (0.0, -0.24, 0.0, np.pi),
    )
    bodies = (
        (395.40, (-0.353, 0.174, -0.004), (16.734, 29.799, 32.815, -1.704, 0.129, 4.404)),
        (339.12, (-0.709, -0.001, 0.023), (7.508, 88.887, 88.674, 0.430, 0.173, -4.397)),
        (105.21, (-0.018, -0.018, -0.076), (10.784, 10.186, 1.943, 0.118, -0.606, -0.102)),
        (35.80, (0.0, 0.236, 0.001), (0.425, 0.218, 0.428, 0.0, -0.011, 0.0)),
        (31.46, (0.0, -0.080, -0.009), (0.284, 0.230, 0.258, 0.0, -0.020, 0.0)),
        (17.78, (0.0, 0.0, -0.050), (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)),
    )
    like = load_robot("kr210_r2700_extra")
    ratio = np.array([1798 / 7, 1872 / 7, 757 / 3, 221.0, 5032 / 21, 206793 / 1340])
    rotor = np.array([0.00923, 0.0118, 0.0118, 0.00173, 0.00173, 0.00173])
    built = _by_dh(like, rows, bodies, down)
    return replace(
        built, name="kr300_r2500_ultra", gear_ratio=ratio, reflected_inertia=rotor * ratio**2
    )


def ur3e() -> RobotModel:
    """Universal Robots UR3e: the maker's DH parameters, masses, centres, torques and speeds; all
    else is estimated as `ir robot new` does.
    """
    rows = (
        (0.0, 0.15185, 0.0, np.pi / 2),
        (0.0, 0.0, -0.24355, 0.0),
        (0.0, 0.0, -0.2132, 0.0),
        (0.0, 0.13105, 0.0, np.pi / 2),
        (0.0, 0.08535, 0.0, -np.pi / 2),
        (0.0, 0.0921, 0.0, 0.0),
    )
    bodies = (
        (1.98, (0.0, -0.02, 0.0), (0.00277, 0.00256, 0.00215, 0.0, 0.0, 0.0)),
        (3.4445, (0.13, 0.0, 0.1157), (0.00426, 0.04603, 0.04489, 0.0, 0.0, -0.0015)),
        (1.437, (0.05, 0.0, 0.0238), (0.00105, 0.01134, 0.01109, 0.0, 0.0, 0.0)),
        (0.871, (0.0, 0.0, 0.01), (0.00082, 0.00055, 0.00068, 0.0, 0.0, 0.0)),
        (0.805, (0.0, 0.0, 0.01), (0.00061, 0.00038, 0.00058, 0.0, 0.0, 0.0)),
        (0.261, (0.0, 0.0, -0.02), (0.00011, 0.00011, 0.00014, 0.0, 0.0, 0.0)),
    )
    like = load_robot("ur10e")
    peak = np.array([56.0, 56.0, 28.0, 12.0, 12.0, 12.0])
    speed = np.radians([180.0, 180.0, 180.0, 360.0, 360.0, 360.0])
    built = _by_dh(like, rows, bodies, np.eye(4))
    whole = estimated(replace(built, name="ur3e"), peak, speed, without_table(link=BUS_48_V))
    places = [f"links.{link}" for link in whole.link_names]
    return replace(
        whole,
        marks={f"{place}.{key}": "M" for place in places for key in ("mass_kg", "com_m")},
    )


def tx40(folder: Path) -> RobotModel:
    """Staubli TX40: links of the URDF in the folder; ratios and the coupling of its wrist by its
    documentation; all else is estimated as `ir robot new` does.
    """
    tree = ElementTree.parse(folder / "tx40_mdh_modified.urdf").getroot()
    links = {each.get("name"): each for each in tree.findall("link")}
    joints = [each for each in tree.findall("joint") if each.get("type") != "fixed"]
    bodies = [_urdf_body(links["base_link"])]
    bodies += [_urdf_body(links[_of(each, "child").get("link")]) for each in joints]
    mass, centre, inertia = (np.array(each) for each in zip(*bodies, strict=True))
    limits = [_of(each, "limit") for each in joints]
    peak, speed = (
        np.array([float(each.get(key, "nan")) for each in limits]) for key in ("effort", "velocity")
    )
    turns = np.eye(6)
    turns[5, 4] = 1.0
    built = replace(
        load_robot("ur10e"),
        name="tx40",
        joint_origin=np.array([_urdf_pose(_of(each, "origin")) for each in joints]),
        joint_axis=np.array([_numbers(_of(each, "axis").get("xyz", "")) for each in joints]),
        position_min=np.full(6, -2.0 * np.pi),
        position_max=np.full(6, 2.0 * np.pi),
        link_mass=mass,
        link_com=centre,
        link_inertia=inertia,
        gear_ratio=np.array([32.0, 32.0, 45.0, 48.0, 45.0, 32.0]),
        motor_turns=turns,
        capsules=(),
        self_pairs=(),
        load_self_capsules=(),
    )
    return estimated(built, peak, speed, without_table())


def estimated(
    robot: RobotModel, peak: FloatArray, speed: FloatArray, power: PowerData
) -> RobotModel:
    """With drives in proportion to their peak torque (n,) Nm and full speed (n,) rad/s."""
    motor = peak / robot.gear_ratio
    return replace(
        robot,
        velocity_max=speed,
        reflected_inertia=_ROTOR * peak / (speed / 0.3),
        friction_viscous=ESTIMATED * peak / speed,
        friction_coulomb=ESTIMATED * peak,
        copper_loss=_COPPER * peak * speed / motor**2,
        envelope_speed=np.column_stack([0.62 * speed, speed]),
        envelope_torque=np.column_stack([peak, 0.9 * peak, 0.5 * peak]),
        controller=power,
        marks={},
        estimated=ESTIMATES,
    )


def _of(item: ElementTree.Element, name: str) -> ElementTree.Element:
    found = item.find(name)
    assert found is not None, f"{item.get('name')} has no {name}"
    return found


def _numbers(text: str) -> FloatArray:
    return np.array([float(each) for each in text.split()])


def _urdf_pose(origin: ElementTree.Element) -> FloatArray:
    roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"))
    turn = _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)
    return _shift(*_numbers(origin.get("xyz", "0 0 0"))) @ turn


def _urdf_body(link: ElementTree.Element) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre and inertia about it, in the frame of the link."""
    inertial = _of(link, "inertial")
    pose = _urdf_pose(_of(inertial, "origin"))
    found = _of(inertial, "inertia")
    keys = ("ixx", "iyy", "izz", "ixy", "iyz", "ixz")
    own = _tensor([float(found.get(key, "0")) for key in keys])
    turn = pose[:3, :3]
    own = turn @ own @ turn.T + 1e-6 * np.eye(3)  # it has links without any
    return float(_of(inertial, "mass").get("value", "0")), pose[:3, 3], own
