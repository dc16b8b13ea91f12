"""Reads a robot file (data/robots/*.yaml) into a RobotModel. Every figure names its source and
confidence.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ir_description.files.power_file import (
    controller_document,
    estimates_of,
    figure,
    marks_of,
    read_controller,
)
from ir_description.poses import rotation_from_abc
from ir_description.robot import Counterbalance, ReducedDistance, RobotModel, without_table
from ir_description.shapes import Capsule
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, RobotFileError
from ir_values.files import read_regular_file, text_of
from ir_values.yaml_errors import document_errors
from ir_values.yaml_items import Item, Table, read_items
from ir_values.yaml_tree import Entry, Node, yaml_text

FORMAT = "ir_description/robot/1"
BIG = 1e12
BYTES_MAX = 1_000_000
"""Largest robot file [bytes]."""
_KEYS = (
    "format",
    "name",
    "rated_payload_kg",
    "machine_home_deg",
    "joints",
    "drives",
    "links",
    "capsules",
    "self_pairs",
    "load_self_capsules",
)
_OPTIONAL = ("title", "controller", "counterbalance")
LIMIT_KEYS = (
    "position_min_deg",
    "position_max_deg",
    "velocity_deg_s",
    "acceleration_rad_s2",
    "jerk_deg_s3",
)
_JOINT_KEYS = ("names", "origin_m", "axis", *LIMIT_KEYS)
DRIVE_KEYS = (
    "gear_ratio",
    "gear_peak_torque_nm",
    "motor_peak_torque_nm",
    "reflected_inertia_kgm2",
    "friction_viscous_nms_rad",
    "friction_coulomb_nm",
    "copper_loss_w_per_nm2",
    "envelope_rad_s_nm",
)
COUPLING = "wrist_coupling"  # of drives, where there is any


def robot_from_yaml(text: str, source: str = "<text>", folder: Path | None = None) -> RobotModel:
    """Return the robot a text describes; errors name file and line. folder: of its controller's
    file.
    """
    return robot_of(read_items(text, source, RobotFileError), folder)


def read_robot(path: Path) -> RobotModel:
    """Return the robot of a file. Raises RobotFileError, InvalidValueError where it can't be
    opened.
    """
    return robot_from_yaml(_decoded(path), str(path), path.parent)


def robot_file_errors(path: Path) -> tuple[RobotFileError, ...]:
    """Everything that is wrong with a robot file, by line; where read_robot reads it, nothing
    is.
    """
    try:
        return robot_errors(_decoded(path), str(path), path.parent)
    except InvalidValueError as error:
        return (RobotFileError(str(path), 0, str(error)),)
    except RobotFileError as error:
        return (error,)


def _decoded(path: Path) -> str:
    return text_of(read_regular_file(path, BYTES_MAX), str(path), RobotFileError)


def robot_errors(text: str, source: str, folder: Path | None) -> tuple[RobotFileError, ...]:
    """All errors of the text of a robot, by line; none: it can be read."""
    found: dict[str, RobotFileError] = {}
    for section in _SECTIONS:  # each by itself: what is wrong in one says nothing of the others
        errors = document_errors(text, source, RobotFileError, partial(_read_section, section))
        found.update({str(error): error for error in errors})
    if not found:
        return document_errors(text, source, RobotFileError, lambda root: robot_of(root, folder))
    return tuple(sorted(found.values(), key=lambda error: error.line))


def _read_section(section: Callable[[Table], object], root: Item) -> None:
    section(root.table(_KEYS, _OPTIONAL))


def robot_of(root: Item, folder: Path | None) -> RobotModel:
    """Return the robot of a document, or of a mapping in one."""
    robot = _robot(root)
    controller = dict(root.pairs()).get("controller")
    power = without_table() if controller is None else read_controller(controller, folder)
    content = root.node.content
    assert isinstance(content, dict)  # _robot has read it
    if controller is not None:
        own = controller_document(controller, power, folder)
        content = {**content, "controller": Entry(controller.line, own)}
    document = yaml_text(Node(root.line, content))
    return replace(
        robot,
        controller=power,
        marks=marks_of(root.node),
        estimated=estimates_of(root.node),
        document=document,
    )


def _robot(root: Item) -> RobotModel:
    """The robot of a file's tree: angles are in degrees there, in radians here."""
    top = root.table(_KEYS, _OPTIONAL)
    top["format"].choice((FORMAT,))
    joints = top["joints"].table(_JOINT_KEYS, ("rotation_abc_deg",))
    joint_names = tuple(item.name() for item in joints["names"].list(1, 16))
    n = len(joint_names)
    drives = top["drives"].table(DRIVE_KEYS, (COUPLING,))
    link_names: tuple[str, ...] = ()
    masses = []
    coms = []
    inertias = []
    for item in top["links"].list(n + 1, n + 1):
        name, mass, com, inertia = _link(item)
        link_names = (*link_names, name)
        masses.append(mass)
        coms.append(com)
        inertias.append(inertia)
    capsules = tuple(_capsule(item, link_names) for item in top["capsules"].list(0, 200))
    pairs = [_pair(item) for item in top["self_pairs"].list(0, 1000)]
    gear_ratio = _joint_values(drives, "gear_ratio", n)
    speed, torque = _envelope(drives, n, gear_ratio)
    with root.blamed():
        return RobotModel(
            name=top["name"].name(),
            joint_names=joint_names,
            link_names=link_names,
            joint_origin=_origins(joints, n),
            joint_axis=figure(joints["axis"]).rows(3, -1, 1, count=(n, n)),
            position_min=np.radians(_joint_values(joints, "position_min_deg", n, -3600)),
            position_max=np.radians(_joint_values(joints, "position_max_deg", n, -3600)),
            velocity_max=np.radians(_joint_values(joints, "velocity_deg_s", n)),
            acceleration_max=_joint_values(joints, "acceleration_rad_s2", n),
            jerk_max=np.radians(_joint_values(joints, "jerk_deg_s3", n)),
            link_mass=np.array(masses),
            link_com=np.array(coms),
            link_inertia=np.array(inertias),
            gear_ratio=gear_ratio,
            reflected_inertia=_joint_values(drives, "reflected_inertia_kgm2", n),
            friction_viscous=_joint_values(drives, "friction_viscous_nms_rad", n),
            friction_coulomb=_joint_values(drives, "friction_coulomb_nm", n),
            copper_loss=_joint_values(drives, "copper_loss_w_per_nm2", n),
            envelope_speed=speed,
            envelope_torque=torque,
            counterbalance=_counterbalance(top.get("counterbalance"), joint_names),
            capsules=capsules,
            self_pairs=tuple(pair for pair, _ in pairs),
            reduced_distances=tuple(reduced for _, reduced in pairs if reduced is not None),
            load_self_capsules=tuple(
                item.name() for item in top["load_self_capsules"].list(0, 200)
            ),
            machine_home=np.radians(_joint_values(top, "machine_home_deg", n, -3600)),
            rated_payload=figure(top["rated_payload_kg"]).number(0, 1e4, "kg", above=True),
            title=top["title"].text(64) if "title" in top else "",
            motor_turns=_motor_turns(drives, n),
        )


def _read_joints(top: Table) -> None:
    joints = top["joints"].table(_JOINT_KEYS, ("rotation_abc_deg",))
    n = len(joints["names"].list(1, 16))
    _origins(joints, n)
    figure(joints["axis"]).rows(3, -1, 1, count=(n, n))
    for key in LIMIT_KEYS:
        _joint_values(joints, key, n, -3600)


def _read_drives(top: Table) -> None:
    drives = top["drives"].table(DRIVE_KEYS, (COUPLING,))
    n = len(figure(drives["gear_ratio"]).list(1, 16))
    for key in DRIVE_KEYS[:-1]:
        _joint_values(drives, key, n)
    _envelope(drives, n, _joint_values(drives, "gear_ratio", n))
    _motor_turns(drives, n)


def _read_capsules(top: Table) -> None:
    names = tuple(dict(item.pairs())["name"].name() for item in top["links"].list(1, 17))
    for item in top["capsules"].list(0, 200):
        _capsule(item, names)


_SECTIONS: tuple[Callable[[Table], object], ...] = (
    lambda top: figure(top["rated_payload_kg"]).number(0, 1e4, "kg", above=True),
    _read_joints,
    _read_drives,
    lambda top: [_link(item) for item in top["links"].list(1, 17)],
    _read_capsules,
)


def inertia_matrix(entries: Sequence[float] | FloatArray) -> FloatArray:
    """Return the matrix (3, 3) of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)


def _joint_values(table: Table, key: str, n: int, low: float = 0.0) -> FloatArray:
    """A figure of every joint (n,)."""
    return figure(table[key]).numbers(n, low, BIG)


def _motor_turns(drives: Table, n: int) -> FloatArray:
    """What a radian of each joint turns each motor (n, n), by rows of motor, joint and share."""
    turns = np.eye(n)
    if COUPLING not in drives:
        return turns
    value = figure(drives[COUPLING])
    for motor, joint, share in value.rows(3, -10.0, 16.0, count=(1, n)):
        if motor not in range(1, n + 1) or joint not in range(1, n + 1) or motor == joint:
            value.fail(
                f"couples motor {motor:g} with axis {joint:g}: two different axes of 1 to {n}"
            )
        turns[int(motor) - 1, int(joint) - 1] = share
    if np.linalg.matrix_rank(turns) < n:
        value.fail("couples the axes so that motors do not determine them")
    return turns


def _origins(joints: Table, n: int) -> FloatArray:
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, 3] = figure(joints["origin_m"]).rows(3, -100, 100, "m", count=(n, n))
    if "rotation_abc_deg" in joints:
        angles = figure(joints["rotation_abc_deg"]).rows(3, -360, 360, "deg", count=(n, n))
        poses[:, :3, :3] = [rotation_from_abc(abc) for abc in angles]
    return poses


def _link(item: Item) -> tuple[str, float, FloatArray, FloatArray]:
    table = item.table(("name", "mass_kg", "com_m", "inertia_kgm2"))
    return (
        table["name"].name(),
        figure(table["mass_kg"]).number(0, 1e5, "kg", above=True),
        figure(table["com_m"]).numbers(3, -100, 100, "m"),
        inertia_matrix(figure(table["inertia_kgm2"]).numbers(6, -1e6, 1e6, "kg m^2")),
    )


def _capsule(item: Item, link_names: tuple[str, ...]) -> Capsule:
    table = item.table(("name", "link", "p0", "p1", "radius"))
    return Capsule(
        name=table["name"].name(),
        link=link_names.index(table["link"].choice(link_names)),
        p0=table["p0"].numbers(3, -100, 100, "m"),
        p1=table["p1"].numbers(3, -100, 100, "m"),
        radius=table["radius"].number(0, 100, "m", above=True),
    )


def _pair(item: Item) -> tuple[tuple[str, str], ReducedDistance | None]:
    """`[a, b]`, or `{pair: [a, b], safety_distance_m: .., reason: ..}`."""
    if not item.is_table():
        first, second = item.list(2, 2)
        return (first.name(), second.name()), None
    table = item.table(("pair", "safety_distance_m", "reason"))
    first, second = table["pair"].list(2, 2)
    pair = first.name(), second.name()
    distance = table["safety_distance_m"].number(-10, 1, "m")
    return pair, ReducedDistance(*pair, distance, table["reason"].text(400))


def _envelope(drives: Table, n: int, gear_ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    peak = np.minimum(
        _joint_values(drives, "gear_peak_torque_nm", n),
        _joint_values(drives, "motor_peak_torque_nm", n) * gear_ratio,
    )
    joints = figure(drives["envelope_rad_s_nm"]).list(n, n)
    count = len(joints[0].list(1, 50))
    pairs = np.array([joint.rows(2, 0, BIG, count=(count, count)) for joint in joints])
    return pairs[:, :, 0], np.hstack([peak[:, None], pairs[:, :, 1]])


def _counterbalance(item: Item | None, joint_names: tuple[str, ...]) -> Counterbalance | None:
    if item is None:
        return None
    if item.is_scalar():
        item.choice(("none",))
        return None
    table = item.table(
        (
            "joint",
            "pivot_m",
            "rod_eye_m",
            "piston_area_m2",
            "gas_volume_m3",
            "charge_pressure_pa",
            "rod_length_at_charge_m",
            "exponent",
        )
    )
    return Counterbalance(
        joint=joint_names.index(table["joint"].choice(joint_names)),
        pivot=figure(table["pivot_m"]).numbers(2, -10, 10, "m"),
        rod_eye=figure(table["rod_eye_m"]).numbers(2, -10, 10, "m"),
        piston_area=figure(table["piston_area_m2"]).number(0, 1, "m^2", above=True),
        gas_volume=figure(table["gas_volume_m3"]).number(0, 10, "m^3", above=True),
        charge_pressure=figure(table["charge_pressure_pa"]).number(0, 1e9, "Pa", above=True),
        rod_length_at_charge=figure(table["rod_length_at_charge_m"]).number(0, 10, "m", above=True),
        exponent=figure(table["exponent"]).number(0, 3, above=True),
    )
