"""Reads a robot file (data/robots/*.yaml) into a RobotModel. Every figure names its source and confidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_description.errors import RobotFileError
from ir_description.files.items import Item, Table, read_items
from ir_description.robot import Counterbalance, RobotModel
from ir_description.shapes import Capsule
from ir_msgs_py.arrays import FloatArray

FORMAT = "ir_description/robot/1"
BIG = 1e12
CONFIDENCES = ("H", "M", "L")


def figure(item: Item) -> Item:
    """Return the value of a figure: a mapping of value, source, confidence and perhaps a note."""
    table = item.table(("value", "source", "confidence"), ("note",))
    table["source"].text()
    table["confidence"].choice(CONFIDENCES)
    if "note" in table:
        table["note"].text(400)
    return table["value"]


_KEYS = (
    "format",
    "name",
    "rated_payload_kg",
    "machine_home_deg",
    "joints",
    "drives",
    "links",
    "counterbalance",
    "capsules",
    "self_pairs",
    "load_self_capsules",
)
_JOINT_KEYS = (
    "names",
    "origin_m",
    "axis",
    "position_min_deg",
    "position_max_deg",
    "velocity_deg_s",
    "acceleration_rad_s2",
    "jerk_deg_s3",
)
_DRIVE_KEYS = (
    "gear_ratio",
    "gear_peak_torque_nm",
    "motor_peak_torque_nm",
    "reflected_inertia_kgm2",
    "friction_viscous_nms_rad",
    "friction_coulomb_nm",
    "copper_loss_w_per_nm2",
    "envelope_rad_s_nm",
)


def robot_from_yaml(text: str, source: str = "<text>") -> RobotModel:  # long: one line per field
    """Return the robot a text describes; errors name file and line."""
    root = read_items(text, source, RobotFileError)
    top = root.table(_KEYS)
    top["format"].choice((FORMAT,))
    joints = top["joints"].table(_JOINT_KEYS)
    joint_names = tuple(item.name() for item in joints["names"].list(1, 16))
    n = len(joint_names)
    drives = top["drives"].table(_DRIVE_KEYS)
    links = [_link(item) for item in top["links"].list(n + 1, n + 1)]
    link_names = tuple(name for name, *_ in links)
    capsules = tuple(_capsule(item, link_names) for item in top["capsules"].list(0, 200))
    gear_ratio = _row(drives, "gear_ratio", n)
    speed, torque = _envelope(drives, n, gear_ratio)
    with root.blamed():
        return RobotModel(
            name=top["name"].name(),
            joint_names=joint_names,
            link_names=link_names,
            joint_origin=_origins(figure(joints["origin_m"]).rows(3, -100, 100, "m", count=(n, n))),
            joint_axis=figure(joints["axis"]).rows(3, -1, 1, count=(n, n)),
            position_min=np.radians(_row(joints, "position_min_deg", n, -3600)),
            position_max=np.radians(_row(joints, "position_max_deg", n, -3600)),
            velocity_max=np.radians(_row(joints, "velocity_deg_s", n)),
            acceleration_max=_row(joints, "acceleration_rad_s2", n),
            jerk_max=np.radians(_row(joints, "jerk_deg_s3", n)),
            link_mass=np.array([mass for _, mass, _, _ in links]),
            link_com=np.array([com for _, _, com, _ in links]),
            link_inertia=np.array([inertia for *_, inertia in links]),
            gear_ratio=gear_ratio,
            reflected_inertia=_row(drives, "reflected_inertia_kgm2", n),
            friction_viscous=_row(drives, "friction_viscous_nms_rad", n),
            friction_coulomb=_row(drives, "friction_coulomb_nm", n),
            copper_loss=_row(drives, "copper_loss_w_per_nm2", n),
            envelope_speed=speed,
            envelope_torque=torque,
            counterbalance=_counterbalance(top["counterbalance"], joint_names),
            capsules=capsules,
            self_pairs=tuple(_pair(item) for item in top["self_pairs"].list(0, 1000)),
            load_self_capsules=tuple(item.name() for item in top["load_self_capsules"].list(0, 200)),
            machine_home=np.radians(_row(top, "machine_home_deg", n, -3600)),
            rated_payload=figure(top["rated_payload_kg"]).number(0, 1e4, "kg", above=True),
        )


def inertia_matrix(entries: Sequence[float] | FloatArray) -> FloatArray:
    """Return the matrix (3, 3) of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)


def _row(table: Table, key: str, n: int, low: float = 0.0) -> FloatArray:
    return figure(table[key]).numbers(n, low, BIG)


def _origins(offsets: FloatArray) -> FloatArray:
    poses = np.tile(np.eye(4), (len(offsets), 1, 1))
    poses[:, :3, 3] = offsets
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


def _pair(item: Item) -> tuple[str, str]:
    first, second = item.list(2, 2)
    return first.name(), second.name()


def _envelope(drives: Table, n: int, gear_ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    peak = np.minimum(
        _row(drives, "gear_peak_torque_nm", n), _row(drives, "motor_peak_torque_nm", n) * gear_ratio
    )
    joints = figure(drives["envelope_rad_s_nm"]).list(n, n)
    count = len(joints[0].list(1, 50))
    pairs = np.array([joint.rows(2, 0, BIG, count=(count, count)) for joint in joints])
    return pairs[:, :, 0], np.hstack([peak[:, None], pairs[:, :, 1]])


def _counterbalance(item: Item, joint_names: tuple[str, ...]) -> Counterbalance | None:
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
