"""A robot file as text: an arm of a URDF, its drive sheet, its capsules and the pairs that can
touch.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np

from ir_description.files.making.estimates import WORTH, peak_torques, usual_speeds
from ir_description.files.making.urdf_arm import AXES, ArmLink, UrdfArm
from ir_description.files.power_file import figure
from ir_description.files.robot_file import COUPLING, DRIVE_KEYS, FORMAT, LIMIT_KEYS
from ir_description.poses import abc_from_rotation
from ir_description.robot import ReducedDistance
from ir_description.shapes import Capsule
from ir_values.arrays import FloatArray
from ir_values.errors import RobotFileError, listed
from ir_values.yaml_items import Item, Table, read_items
from ir_values.yaml_tree import Node, yaml_text

# The sheet of drive figures beside a URDF: what a URDF does not say, each known, or estimated and
# marked so. The estimates are the proportions of the KR 210 R2700 extra, whose drives are known:
# see `TEMPLATE`, which says for each figure what it is and what happens where it is unknown.

SHEET_FORMAT = "ir_description/drives/1"
TEMPLATE = (files("ir_description") / "data" / "drives.yaml").read_text(encoding="utf-8")
UNKNOWN = "unknown"

RAMP = 0.3  # s from rest to full speed: KR 210 0.28 to 0.52 s
JERK_TIME = 0.1  # s from no to full acceleration
RATIO = 100.0
ROTOR_SHARE = 1.0 / 3.0  # of the peak torque that the rotor alone takes at the acceleration limit
FRICTION_SHARE = 0.08  # of the peak torque, each: Coulomb, and viscous at full speed
COPPER_SHARE = 0.03  # of the peak power, lost in the windings at peak torque
TURNS_MAX = 4.0
"""Turns to either side of a limit in rad: cables let arms turn 1.5 at most, so more are degrees."""
SPEED_MAX = 30.0
"""Full speed of an axis [rad/s]: the fastest of public arms of six axes has 25 (1445 deg/s), and
the slowest axes turn at more than 30 deg/s.
"""
# of full speed; torque there and at full speed, of the peak
BEND = 0.62
AT_BEND = 0.9
AT_FULL = 0.5


@dataclass(frozen=True, eq=False)
class Value:
    """A figure: numbers (any shape), where they are from, how sure they are, and a note."""

    numbers: FloatArray
    source: str
    confidence: str
    note: str = ""


@dataclass(frozen=True, eq=False)
class DriveSheet:
    """name, title, joint_names, link_names ((): those of the URDF); values: figures by their key in
    a robot file; controller, counterbalance: as they were written, None where not; radii (7,) [m]
    of capsules for links without a mesh.
    """

    name: str
    title: str
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    values: dict[str, Value]
    controller: Node | None
    counterbalance: Node | None
    radii: FloatArray | None
    notes: tuple[str, ...] = ()


_KEYS = ("format", "name", "rated_payload_kg")
_ROWS = {
    "position_min_deg": ("deg", -3600.0),
    "position_max_deg": ("deg", -3600.0),
    "velocity_deg_s": ("deg/s", 0.0),
    "acceleration_rad_s2": ("rad/s^2", 0.0),
    "jerk_deg_s3": ("deg/s^3", 0.0),
    "gear_ratio": ("", 0.0),
    "gear_peak_torque_nm": ("Nm", 0.0),
    "motor_peak_torque_nm": ("Nm", 0.0),
    "reflected_inertia_kgm2": ("kg m^2", 0.0),
    "friction_viscous_nms_rad": ("Nm s/rad", 0.0),
    "friction_coulomb_nm": ("Nm", 0.0),
    "copper_loss_w_per_nm2": ("W/Nm^2", 0.0),
}
_OPTIONAL = (
    "machine_home_deg",
    "title",
    "joint_names",
    "link_names",
    "controller",
    "counterbalance",
    "capsule_radius_m",
    "envelope_rad_s_nm",
    "wrist_coupling",
    *_ROWS,
)


def drive_sheet(text: str, source: str, arm: UrdfArm) -> DriveSheet:
    """Read a sheet for an arm, and estimate what it does not know. Raises RobotFileError."""
    top = read_items(text, source, RobotFileError).table(_KEYS, _OPTIONAL)
    top["format"].choice((SHEET_FORMAT,))
    given = {key: _given_values(top, key, unit, low) for key, (unit, low) in _ROWS.items()}
    known = {key: values for key, values in given.items() if values is not None}
    known["rated_payload_kg"] = _value(
        top["rated_payload_kg"], lambda item: item.number(0, 1e4, "kg", above=True)
    )
    if "machine_home_deg" in top and not _is_unknown(top["machine_home_deg"]):
        known["machine_home_deg"] = _value(
            top["machine_home_deg"], lambda item: item.numbers(AXES, -3600, 3600, "deg")
        )
    if "envelope_rad_s_nm" in top and not _is_unknown(top["envelope_rad_s_nm"]):
        known["envelope_rad_s_nm"] = _value(top["envelope_rad_s_nm"], _envelope)
    if "wrist_coupling" in top and not _is_unknown(top["wrist_coupling"]):
        known["wrist_coupling"] = _value(
            top["wrist_coupling"], lambda item: item.rows(3, -10, 16, count=(1, AXES))
        )
    notes = _complete(known, arm, source)
    radii = (
        top["capsule_radius_m"].numbers(AXES + 1, 0, 100, "m", above=True)
        if "capsule_radius_m" in top
        else None
    )
    return DriveSheet(
        name=top["name"].name(),
        title=top["title"].text(64) if "title" in top else "",
        joint_names=_names(top, "joint_names", AXES),
        link_names=_names(top, "link_names", AXES + 1),
        values=known,
        controller=top["controller"].node if "controller" in top else None,
        counterbalance=top["counterbalance"].node if "counterbalance" in top else None,
        radii=radii,
        notes=notes,
    )


def estimated_sheet(name: str, title: str, payload: float, arm: UrdfArm) -> DriveSheet:
    """The sheet of an arm of which only its payload [kg] is known."""
    known = {"rated_payload_kg": Value(np.array(payload), "stated", "M")}
    notes = _complete(known, arm, arm.name)
    return DriveSheet(name, title, (), (), known, None, None, None, notes)


def with_home(sheet: DriveSheet, home: Value) -> DriveSheet:
    """The sheet with a machine home [deg]."""
    return replace(sheet, values={**sheet.values, "machine_home_deg": home})


def _is_unknown(item: Item) -> bool:
    return item.is_scalar() and item.text() == UNKNOWN


def _given_values(top: Table, key: str, unit: str, low: float) -> Value | None:
    """A figure of every axis, None where it is not given or unknown."""
    if key not in top or _is_unknown(top[key]):
        return None
    return _value(top[key], lambda item: item.numbers(AXES, low, 1e12, unit))


def _value(item: Item, read: Callable[[Item], object]) -> Value:
    numbers = np.array(read(figure(item)))
    table = item.table(("value", "source", "confidence"), ("note",))
    note = table["note"].text(400) if "note" in table else ""
    return Value(numbers, table["source"].text(), table["confidence"].text(), note)


def _envelope(item: Item) -> FloatArray:
    joints = item.list(AXES, AXES)
    count = len(joints[0].list(1, 50))
    return np.array([joint.rows(2, 0, 1e12, count=(count, count)) for joint in joints])


def _names(top: Table, key: str, count: int) -> tuple[str, ...]:
    return tuple(item.name() for item in top[key].list(count, count)) if key in top else ()


def _complete(known: dict[str, Value], arm: UrdfArm, source: str) -> tuple[str, ...]:
    """Take from the URDF what it has, and estimate the rest; sentences on what it has and was not
    taken. Raises RobotFileError for ranges that are none, and for figures of the URDF in another
    unit.
    """
    _check_units(known, arm)

    def estimated(key: str, numbers: FloatArray, note: str) -> None:
        known.setdefault(key, Value(np.asarray(numbers), "estimate", "L", note))

    ends = np.array([_range(joint.kind, joint.lower, joint.upper) for joint in arm.joints])
    known.setdefault("position_min_deg", Value(ends[:, 0], "URDF", "M"))
    known.setdefault("position_max_deg", Value(ends[:, 1], "URDF", "M"))
    low = known["position_min_deg"].numbers
    high = known["position_max_deg"].numbers
    if not (low < high).all():
        k = int(np.argmin(low < high))
        raise RobotFileError(
            source,
            0,
            f"joint {arm.joints[k].name} may turn from {low[k]:g} to {high[k]:g} deg: "
            "position_min_deg must be below position_max_deg",
        )
    notes = []
    speeds = np.degrees([joint.velocity for joint in arm.joints])
    if speeds.all():
        known.setdefault("velocity_deg_s", Value(speeds, "URDF", "M"))
    else:
        usual = np.where(speeds > 0.0, speeds, usual_speeds(arm.reach))
        estimated("velocity_deg_s", usual, "usual for the reach where the URDF has none")
    if "gear_peak_torque_nm" not in known:
        known["gear_peak_torque_nm"], note = _torques(known, arm)
        notes += note
    speed = np.radians(known["velocity_deg_s"].numbers)
    peak = known["gear_peak_torque_nm"].numbers
    estimated("acceleration_rad_s2", speed / RAMP, f"full speed in {RAMP:g} s")
    reached = known["acceleration_rad_s2"].numbers
    estimated(
        "jerk_deg_s3", np.degrees(reached) / JERK_TIME, f"full acceleration in {JERK_TIME:g} s"
    )
    estimated(
        "gear_ratio",
        np.full(AXES, RATIO),
        "usual; only the split between motor and gear follows from it",
    )
    ratio = known["gear_ratio"].numbers
    estimated("motor_peak_torque_nm", peak / ratio, "as much as the gear takes")
    estimated(
        "reflected_inertia_kgm2",
        ROTOR_SHARE * peak / reached,
        "a third of the peak torque at the acceleration limit",
    )
    estimated(
        "friction_viscous_nms_rad",
        FRICTION_SHARE * peak / speed,
        "8 % of the peak torque at full speed",
    )
    estimated("friction_coulomb_nm", FRICTION_SHARE * peak, "8 % of the peak torque")
    motor = known["motor_peak_torque_nm"].numbers
    estimated(
        "copper_loss_w_per_nm2",
        COPPER_SHARE * peak * speed / motor**2,
        "3 % of the peak power at peak torque",
    )
    least = np.minimum(peak, motor * ratio)
    pairs = [[[BEND * v, AT_BEND * t], [v, AT_FULL * t]] for v, t in zip(speed, least, strict=True)]
    estimated(
        "envelope_rad_s_nm",
        np.array(pairs),
        "peak torque to 62 % of full speed, half of it at full speed",
    )
    return tuple(notes)


def _check_units(known: Mapping[str, Value], arm: UrdfArm) -> None:
    """Raise RobotFileError for limits and speeds of the URDF that are none of an arm, where the
    sheet does not say them itself.
    """
    most = TURNS_MAX * 2.0 * np.pi
    for joint in arm.joints:
        limits = {"position_min_deg": joint.lower, "position_max_deg": joint.upper}
        beyond = [limits[key] for key in limits if key not in known and abs(limits[key]) > most]
        if beyond:
            raise RobotFileError(
                arm.source,
                joint.line,
                f"joint {joint.name} may turn to {beyond[0]:g} rad, must be within {most:.4g} rad "
                f"({TURNS_MAX:g} turns): degrees? write rad, make it continuous without limits, or "
                "give position_min_deg and position_max_deg in the drive sheet (--drives)",
            )
        if "velocity_deg_s" not in known and joint.velocity > SPEED_MAX:
            raise RobotFileError(
                arm.source,
                joint.line,
                f"joint {joint.name} turns at {joint.velocity:g} rad/s, must be at most "
                f"{SPEED_MAX:g} rad/s: degrees? write rad/s, or give velocity_deg_s in the drive "
                "sheet (--drives)",
            )


def _range(kind: str, lower: float, upper: float) -> tuple[float, float]:
    """deg; an endless joint turns once to both sides."""
    endless = kind == "continuous" and not lower < upper
    return (-360.0, 360.0) if endless else (float(np.degrees(lower)), float(np.degrees(upper)))


def _torques(known: Mapping[str, Value], arm: UrdfArm) -> tuple[Value, list[str]]:
    """Peak torques: the efforts of the URDF where these can be meant, else estimates."""
    low, high = (np.radians(known[f"position_{end}_deg"].numbers) for end in ("min", "max"))
    peak, held = peak_torques(arm, low, high, float(known["rated_payload_kg"].numbers))
    effort = np.array([joint.effort for joint in arm.joints])
    meant = (effort >= WORTH[0] * held) & (effort <= WORTH[1] * peak) & (effort > 0.0)
    if meant.all():
        return Value(effort, "URDF", "M"), []
    notes = [
        f"effort of {joint.name} is {joint.effort:g} Nm in the URDF, holding arm and payload needs "
        f"{need:.3g} Nm: {estimate:.3g} Nm are taken{_with_doubts(arm.links[i + 1 :])}"
        for i, (joint, need, estimate, good) in enumerate(
            zip(arm.joints, held, peak, meant, strict=True)
        )
        if joint.effort > 0.0 and not good
    ]
    note = "1.5 times what holds arm and payload where the URDF has none that can be meant"
    return Value(np.where(meant, effort, peak), "estimate", "L", note), notes


def _with_doubts(links: Sequence[ArmLink]) -> str:
    """What an estimate follows from that is doubted."""
    names = [link.place for link in links if link.doubted]
    return f", with the doubted centre of mass of {listed(names)} as it stands" if names else ""


_DIGITS = 11  # significant ones: more than any figure has, fewer than rounding spoils
_ALL_DIGITS = 17  # of an axis, whose length must be 1 to 1e-12


def robot_text(
    arm: UrdfArm,
    sheet: DriveSheet,
    capsules: Sequence[Capsule],
    self_pairs: Iterable[tuple[str, str]],
    reduced: Iterable[ReducedDistance] = (),
    comments: Iterable[str] = (),
) -> str:
    """The robot file; `comments` stand at its top."""
    return "\n".join(_lines(arm, sheet, capsules, self_pairs, reduced, comments)) + "\n"


def _lines(
    arm: UrdfArm,
    sheet: DriveSheet,
    capsules: Sequence[Capsule],
    self_pairs: Iterable[tuple[str, str]],
    reduced: Iterable[ReducedDistance],
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
    yield f"  axis: {_figure(Value(arm.axis, 'URDF', 'H'), _ALL_DIGITS)}"
    yield from (f"  {key}: {_figure(sheet.values[key])}" for key in LIMIT_KEYS)
    yield "drives:"
    rows = [*DRIVE_KEYS, *([COUPLING] if COUPLING in sheet.values else [])]
    yield from (f"  {key}: {_figure(sheet.values[key])}" for key in rows)
    yield "links:"
    for name, link in zip(links, arm.links, strict=True):
        J = link.inertia
        entries = np.array([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])
        yield f"  - name: {name}"
        whence = ("estimate", "L", link.estimate) if link.estimate else ("URDF", "M")
        of_com = ("URDF", "L", "far from all bodies of the link") if link.doubted else whence
        of_inertia = ("estimate", "L", link.moments) if link.moments else whence
        yield f"    mass_kg: {_figure(Value(np.array(link.mass), *whence))}"
        yield f"    com_m: {_figure(Value(link.com, *of_com))}"
        yield f"    inertia_kgm2: {_figure(Value(entries, *of_inertia))}"
    yield from _written("counterbalance", sheet.counterbalance)
    yield "capsules:"
    for capsule in capsules:
        ends = f"p0: {_flow(capsule.p0)}, p1: {_flow(capsule.p1)}, radius: {_flow(capsule.radius)}"
        yield f"  - {{name: {capsule.name}, link: {links[capsule.link]}, {ends}}}"
    pairs = list(self_pairs)
    yield "self_pairs:" if pairs else "self_pairs: []"
    own = {frozenset(each[:2]): each for each in reduced}
    for pair in pairs:
        listed = f"[{pair[0]}, {pair[1]}]"
        each = own.get(frozenset(pair))
        if each is None:
            yield f"  - {listed}"
        else:
            distance = f"safety_distance_m: {_flow(each.distance)}"
            yield f"  - {{pair: {listed}, {distance}, reason: {json.dumps(each.reason)}}}"
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


def _figure(value: Value, digits: int = _DIGITS) -> str:
    note = f", note: {json.dumps(value.note)}" if value.note else ""
    own = _flow(value.numbers, digits)
    return (
        f"{{value: {own}, source: {json.dumps(value.source)}, confidence: "
        f"{value.confidence}{note}}}"
    )


def _flow(values: FloatArray | float, digits: int = _DIGITS) -> str:
    return json.dumps(_rounded(np.asarray(values, dtype=np.float64).tolist(), digits))


def _rounded(values: object, digits: int) -> object:
    if isinstance(values, list):
        return [_rounded(value, digits) for value in values]
    return float(f"{values:.{digits}g}") + 0.0
