"""`ir robot new`: a robot file from a URDF and what is known of its drives."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ir_cli.errors import CommandError, InputError
from ir_cli.home_posture import Postures
from ir_cli.robot_remarks import remarks_on
from ir_cli.robot_shapes import Shapes, capsules_of
from ir_cli.self_pairs import Pairs, kept_sentences, pairs_of
from ir_description import DescriptionError, InvalidValueError, RobotModel
from ir_description.files import read_regular_file, robot_from_yaml, text_of
from ir_description.files.making import (
    DriveSheet,
    LinkBody,
    Meshes,
    UrdfArm,
    Value,
    drive_sheet,
    estimated_sheet,
    expanded,
    link_bodies,
    link_names,
    robot_text,
    urdf_arm,
    with_home,
    with_masses,
    xml_text,
)
from ir_kernels import Chain, KernelError
from ir_kernels.wrist_geometry import arm_lines
from ir_values.arrays import FloatArray
from ir_values.errors import RobotFileError
from ir_values.output_files import write_file

BYTES_MAX = 8_000_000
ROUNDED = 1e-10
"""Share by which a limit in a robot file, in degrees of eleven digits, may be off the URDF's."""


@dataclass(frozen=True)
class RobotSource:
    """What a robot file is made from: a URDF or xacro file, a drive sheet or a payload [kg], the
    mass [kg] of the arm; tip: link at the flange ("": found); without: links that are left out;
    packages: a folder below which packages lie. settings: arguments of a xacro file by name.
    """

    urdf: Path
    drives: Path | None = None
    payload: float | None = None
    mass: float | None = None
    tip: str = ""
    without: tuple[str, ...] = ()
    packages: Path | None = None
    settings: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class MadeRobot:
    """A robot file as text, read back as `robot`, and sentences on how it was made."""

    text: str
    robot: RobotModel
    arm: UrdfArm
    bodies: tuple[tuple[LinkBody, ...], ...]
    shapes: Shapes
    pairs: Pairs
    notes: tuple[str, ...]


def made_robot(source: RobotSource) -> MadeRobot:
    """The robot of a URDF. Raises InputError with the place and the remedy."""
    try:
        return _made(source)
    except RobotFileError as error:
        raise InputError(str(error)) from error
    except (DescriptionError, InvalidValueError) as error:
        place = "" if str(source.urdf) in str(error) else f"{source.urdf}: "
        raise InputError(f"{place}{error}") from error


def _made(source: RobotSource) -> MadeRobot:
    """The robot of a URDF and its sheet, step by step: arm, masses, capsules, the pairs of these
    that are checked, and the file that all of it is written to, read again.
    """
    urdf = source.urdf
    arm = urdf_arm(urdf_text(source), str(urdf), source.tip, source.without)
    _check_axes(arm)
    meshes = Meshes(urdf.parent, source.packages)
    bodies = tuple(tuple(link_bodies(link.shapes, meshes)) for link in arm.links)
    if not any(bodies):
        raise RobotFileError(str(urdf), 0, "no link has a body: there is nothing to keep clear")
    arm, masses = with_masses(arm, bodies, source.mass)
    sheet = _sheet(source, arm)
    names = link_names(arm, sheet)
    low = np.radians(sheet.values["position_min_deg"].numbers)
    high = np.radians(sheet.values["position_max_deg"].numbers)
    check_leaders(arm, low, high)
    given = sheet.values.get("machine_home_deg")
    home = None if given is None else np.asarray(np.radians(given.numbers), dtype=np.float64)
    shapes = capsules_of(arm, bodies, names, sheet.radii)
    pairs = pairs_of(arm, shapes.capsules, bodies, low, high, home)
    if pairs.unclear:  # more and tighter capsules, where they leave the arm as many postures
        more = capsules_of(arm, bodies, names, sheet.radii, before=shapes, finer=pairs.unclear)
        tighter = pairs_of(arm, more.capsules, bodies, low, high, home, finer=pairs.unclear)
        if tighter.left >= pairs.left:
            shapes = more
            pairs = tighter
    notes = [*arm.notes, *meshes.notes, *masses, *sheet.notes]
    if given is None:
        sheet = with_home(sheet, _home(arm, sheet, shapes, pairs, (low, high)))
    comments = _comments(source, shapes, notes)
    text = robot_text(arm, sheet, shapes.capsules, pairs.pairs, pairs.reduced, comments)
    robot = robot_from_yaml(text, f"the robot made from {urdf}", _folder(source))
    return MadeRobot(
        text=text,
        robot=robot,
        arm=arm,
        bodies=bodies,
        shapes=shapes,
        pairs=pairs,
        notes=tuple(notes),
    )


def _check_axes(arm: UrdfArm) -> None:
    """Raise InvalidValueError for an arm whose axes no inverse kinematics here solves."""
    try:
        arm_lines(Chain(arm))
    except KernelError as error:
        names = ", ".join(joint.name for joint in arm.joints)
        raise InvalidValueError(f"{error}; its axes are {names}, see --tip") from error


def check_leaders(arm: UrdfArm, low: FloatArray, high: FloatArray) -> None:
    """Raise InvalidValueError where joints turn farther than what follows them was swept."""
    for joint, lower, upper in zip(arm.joints, low, high, strict=True):
        beyond = max(
            joint.lower - lower - ROUNDED * abs(joint.lower),
            upper - joint.upper - ROUNDED * abs(joint.upper),
        )
        if joint.name in arm.leaders and beyond > 0.0:
            limits = [f"{np.degrees(each):g}" for each in (lower, upper, joint.lower, joint.upper)]
            raise InvalidValueError(
                f"joint {joint.name} turns from {limits[0]} to {limits[1]} deg by the drive sheet, "
                f"but other joints follow it (<mimic>), and the URDF turns it from {limits[2]} to "
                f"{limits[3]} deg: write the same limits into both"
            )


def _home(
    arm: UrdfArm,
    sheet: DriveSheet,
    shapes: Shapes,
    pairs: Pairs,
    limits: tuple[FloatArray, FloatArray],
) -> Value:
    peak = np.minimum(
        sheet.values["gear_peak_torque_nm"].numbers,
        sheet.values["motor_peak_torque_nm"].numbers * sheet.values["gear_ratio"].numbers,
    )
    payload = float(sheet.values["rated_payload_kg"].numbers)
    found = Postures(arm, shapes.capsules, pairs, limits, peak, payload).home()
    home = np.asarray(np.round(np.degrees(found), 3), dtype=np.float64)
    return Value(home, "search", "M", "free of itself, above the floor, and held with the payload")


def _sheet(source: RobotSource, arm: UrdfArm) -> DriveSheet:
    if source.drives is not None:
        content = read_regular_file(source.drives, BYTES_MAX)
        text = text_of(content, str(source.drives), RobotFileError)
        return drive_sheet(text, str(source.drives), arm)
    if source.payload is None:
        raise InputError(
            f"{source.urdf}: a URDF does not say what the robot may carry: give --payload KG, or a "
            "drive sheet with --drives FILE (ir robot new --template prints an empty one)"
        )
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", source.urdf.name.partition(".")[0]).lstrip(
        "0123456789_.-"
    )
    return estimated_sheet(name[:64] or "robot", arm.name[:64], source.payload, arm)


def urdf_text(source: RobotSource) -> str:
    """The URDF, expanded where it is a xacro file."""
    text = xml_text(read_regular_file(source.urdf, BYTES_MAX), str(source.urdf))
    if source.urdf.suffix == ".xacro" or "<xacro:" in text:
        return expanded(source.urdf, source.packages, source.settings)
    if source.settings:
        raise InputError(f"{source.urdf}: --set is for arguments of a xacro file, this is a URDF")
    return text


def _folder(source: RobotSource) -> Path:
    """Where a controller's file of the sheet lies."""
    return (source.drives or source.urdf).parent


def write_robot(source: RobotSource, out: Path) -> MadeRobot:
    """Write the robot file, and say how well it fits. Raises InputError, CommandError."""
    made = made_robot(source)
    errors = [each for each in remarks_on(made.robot) if each.severity == "error"]
    if errors:
        said = "; ".join(f"{each.subject}: {each.sentence}" for each in errors)
        raise CommandError(f"{source.urdf}: {out} is not written, nothing could be planned: {said}")
    try:
        write_file(out, made.text)
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror}") from error
    _say(out, made)
    return made


def _comments(source: RobotSource, shapes: Shapes, notes: Sequence[str]) -> list[str]:
    sheet = f" and {source.drives.name}" if source.drives else ""
    lines = [
        f"Written from {source.urdf.name}{sheet}. Frames: parallel to the base at q = 0, the "
        "last at the",
        "flange with x out. Capsules, and how far they stand out from what they enclose:",
        *(f"  {sentence}" for sentence in shapes.sentences),
    ]
    if notes:
        lines += ["Read otherwise than it stands there, or estimated:", *(f"  {n}" for n in notes)]
    return [line.replace("\n", " ") for line in lines]


def _say(out: Path, made: MadeRobot) -> None:
    robot = made.robot
    lines = [*made.shapes.sentences]
    lines += [f"note: {note}" for note in made.notes]
    bodies = sum(map(len, made.bodies))
    lines.append(
        f"{bodies} bodies of the URDF in {len(robot.capsules)} capsules; "
        f"{len(robot.self_pairs)} pairs of them can touch, neighbours are left out"
    )
    lines += kept_sentences(made.pairs.reduced, robot.capsules)
    guessed = sorted({p.rpartition(".")[2] for p, mark in robot.marks.items() if mark == "L"})
    if guessed:
        lines.append(f"estimated (confidence L): {', '.join(guessed)}")
    lines.append(f"home: {np.round(np.degrees(robot.machine_home), 3).tolist()} deg")
    lines.append(
        f"{out}: robot {robot.name} of {robot.n} axes; next: ir robot check {out}, "
        f"ir plan --robot {out}"
    )
    sys.stdout.write("\n".join(lines) + "\n")
