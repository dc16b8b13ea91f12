"""A robot file as text: an arm of a URDF, its drive sheet, its capsules and the pairs that can
touch.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ir_description.files.making.drive_sheet import DriveSheet, Value
from ir_description.files.making.urdf_arm import UrdfArm
from ir_description.files.robot_file import FORMAT
from ir_description.files.yaml_text import yaml_text
from ir_description.files.yaml_tree import Node
from ir_description.poses import abc_from_rotation
from ir_description.shapes import Capsule
from ir_msgs_py.arrays import FloatArray

_DIGITS = 11  # significant ones: more than any figure has, fewer than rounding spoils
_JOINT_ROWS = (
    "position_min_deg",
    "position_max_deg",
    "velocity_deg_s",
    "acceleration_rad_s2",
    "jerk_deg_s3",
)
_DRIVE_ROWS = (
    "gear_ratio",
    "gear_peak_torque_nm",
    "motor_peak_torque_nm",
    "reflected_inertia_kgm2",
    "friction_viscous_nms_rad",
    "friction_coulomb_nm",
    "copper_loss_w_per_nm2",
    "envelope_rad_s_nm",
)


def robot_text(
    arm: UrdfArm,
    sheet: DriveSheet,
    capsules: Sequence[Capsule],
    self_pairs: Iterable[tuple[str, str]],
    comments: Iterable[str] = (),
) -> str:
    """The robot file; `comments` stand at its top."""
    return "\n".join(_lines(arm, sheet, capsules, self_pairs, comments)) + "\n"


def _lines(
    arm: UrdfArm,
    sheet: DriveSheet,
    capsules: Sequence[Capsule],
    self_pairs: Iterable[tuple[str, str]],
    comments: Iterable[str],
) -> Iterator[str]:
    links = link_names(arm, sheet)
    yield from (f"# {comment}" for comment in comments)
    yield f"format: {FORMAT}"
    yield f"name: {sheet.name}"
    if sheet.title:
        yield f"title: {json.dumps(sheet.title)}"
    yield from _written("controller", sheet.controller)
    yield from (
        f"{key}: {_figure(sheet.values[key])}" for key in ("rated_payload_kg", "machine_home_deg")
    )
    yield "joints:"
    names = sheet.joint_names or tuple(joint.name for joint in arm.joints)
    yield f"  names: [{', '.join(names)}]"
    yield f"  origin_m: {_figure(Value(arm.origin, 'URDF', 'H'))}"
    if not np.array_equal(arm.flange, np.eye(3)):
        angles = np.zeros((len(names), 3))
        angles[-1] = abc_from_rotation(arm.flange)
        yield (
            "  rotation_abc_deg: "
            f"{_figure(Value(angles, 'URDF', 'H', 'x of the flange points out'))}"
        )
    yield f"  axis: {_figure(Value(arm.axis, 'URDF', 'H'))}"
    yield from (f"  {key}: {_figure(sheet.values[key])}" for key in _JOINT_ROWS)
    yield "drives:"
    yield from (f"  {key}: {_figure(sheet.values[key])}" for key in _DRIVE_ROWS)
    yield "links:"
    for name, link in zip(links, arm.links, strict=True):
        J = link.inertia
        entries = np.array([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])
        yield f"  - name: {name}"
        yield f"    mass_kg: {_figure(Value(np.array(link.mass), 'URDF', 'M'))}"
        yield f"    com_m: {_figure(Value(link.com, 'URDF', 'M'))}"
        yield f"    inertia_kgm2: {_figure(Value(entries, 'URDF', 'M'))}"
    yield from _written("counterbalance", sheet.counterbalance)
    yield "capsules:"
    for capsule in capsules:
        ends = f"p0: {_row(capsule.p0)}, p1: {_row(capsule.p1)}, radius: {_row(capsule.radius)}"
        yield f"  - {{name: {capsule.name}, link: {links[capsule.link]}, {ends}}}"
    pairs = list(self_pairs)
    yield "self_pairs:" if pairs else "self_pairs: []"
    yield from (f"  - [{a}, {b}]" for a, b in pairs)
    last = len(links) - 1
    loaded = [capsule.name for capsule in capsules if capsule.link < last - 1]
    yield f"load_self_capsules: [{', '.join(loaded)}]"


def link_names(arm: UrdfArm, sheet: DriveSheet) -> tuple[str, ...]:
    """Names of the links from the base on."""
    return sheet.link_names or tuple(link.name for link in arm.links)


def _written(key: str, node: Node | None) -> Iterator[str]:
    if node is None:
        return
    lines = yaml_text(node).splitlines()
    if len(lines) == 1:
        yield f"{key}: {lines[0]}"
    else:
        yield f"{key}:"
        yield from (f"  {line}" for line in lines)


def _figure(value: Value) -> str:
    note = f", note: {json.dumps(value.note)}" if value.note else ""
    own = _row(value.numbers)
    return (
        f"{{value: {own}, source: {json.dumps(value.source)}, confidence: "
        f"{value.confidence}{note}}}"
    )


def _row(values: FloatArray | float) -> str:
    return json.dumps(_rounded(np.asarray(values, dtype=np.float64).tolist()))


def _rounded(values: object) -> object:
    if isinstance(values, list):
        return [_rounded(value) for value in values]
    return float(f"{values:.{_DIGITS}g}") + 0.0
