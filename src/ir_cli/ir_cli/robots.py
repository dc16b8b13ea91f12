"""`ir robot`: bundled robots listed, robot files checked, new ones made from a URDF."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from ir_cli.errors import InputError, unknown_name
from ir_cli.output import (
    Row,
    add_formats,
    add_renamed,
    number,
    print_csv,
    print_json,
    print_table,
    text,
)
from ir_description import (
    DescriptionFileError,
    Load,
    RobotModel,
    UnknownNameError,
    bundled_robots,
    is_path,
    load_robot,
    robot_file_errors,
    robot_named,
)
from ir_kernels import (
    Chain,
    CollisionModel,
    DynamicsModel,
    SearchedIk,
    SphericalWristIk,
    ThreeParallelIk,
    inverse_kinematics,
)
from ir_kernels import (
    InputError as KernelInputError,
)
from ir_kernels.wrist_geometry import arm_lines
from ir_msgs_py.arrays import FloatArray

# Remarks on a robot's data, before anything is planned with it.

MARGIN = 0.02  # m, the default of a request
POSTURES = 2000  # random ones in which the drives hold the arm, and links keep their distance
NEAR = 0.4  # share of postures; of the bundled robots' pairs 0.31 at most
METHODS = {
    SphericalWristIk: "closed form (spherical wrist)",
    ThreeParallelIk: "closed form (axes 2, 3 and 4 parallel)",
    SearchedIk: "search over axis 4 (no spherical wrist)",
}


class Remark(NamedTuple):
    """error: nothing can be planned. warning: plans are possible, but. note: good to know."""

    severity: Literal["error", "warning", "note"]
    subject: str
    sentence: str


def remarks_on(robot: RobotModel) -> tuple[Remark, ...]:
    """What is to be said of a robot, errors first."""
    chain = Chain(robot)
    try:
        arm_lines(chain)
    except KernelInputError as error:
        return (Remark("error", "axes", str(error)),)
    solver = inverse_kinematics(chain, robot.position_min, robot.position_max)
    found = [
        Remark("note", "inverse kinematics", METHODS[type(solver)]),
        *_home(robot, chain),
        *_near_itself(robot, chain),
        *_torque(robot),
        *_speed(robot),
        *_controller(robot),
        *_wrist(robot),
        Remark(
            "note",
            "time_value",
            f"a second is worth {robot.time_value:g} W where a request does not say",
        ),
        *_marks(robot),
    ]
    order = ("error", "warning", "note")
    return tuple(sorted(found, key=lambda remark: order.index(remark.severity)))


def _home(robot: RobotModel, chain: Chain) -> Iterator[Remark]:
    if not robot.self_pairs:
        yield Remark("warning", "self_pairs", "is empty: the robot is never checked against itself")
        return
    model = CollisionModel(chain, robot.capsules, (), robot.self_pairs)
    distance = model.distances(robot.machine_home[None])[0]
    for z in np.flatnonzero(distance <= MARGIN):
        pair = model.pairs[int(z)]
        depth = 1e3 * float(distance[z])
        yield Remark(
            "error",
            "machine_home_deg",
            f"{pair.body_a} and {pair.body_b} are {depth:.1f} mm apart there, must be above "
            f"{1e3 * MARGIN:g} mm: choose another posture, or smaller capsules",
        )


def _postures(robot: RobotModel) -> FloatArray:
    """Random ones (N, n)."""
    return np.random.default_rng(0).uniform(
        robot.position_min, robot.position_max, (POSTURES, robot.n)
    )


def _near_itself(robot: RobotModel, chain: Chain) -> Iterator[Remark]:
    """Pairs of links that leave few postures to plan in."""
    model = CollisionModel(chain, robot.capsules, (), robot.self_pairs)
    near = (
        (model.distances(_postures(robot)) <= MARGIN).mean(axis=0)
        if robot.self_pairs
        else np.zeros(0)
    )
    for z in np.flatnonzero(near > NEAR):
        pair = model.pairs[int(z)]
        often = f"{1e3 * MARGIN:g} mm in {100.0 * near[z]:.0f} % of {POSTURES} postures"
        yield Remark(
            "warning",
            "self_pairs",
            f"{pair.body_a} and {pair.body_b} come nearer than {often}, where nothing is planned: "
            "smaller capsules, or without this pair where the links themselves can't touch",
        )


def _torque(robot: RobotModel) -> Iterator[Remark]:
    """Whether the drives hold the arm, empty and with the rated payload at the flange."""
    load = Load("payload", "tool", robot.rated_payload, np.zeros(3), np.eye(3) * 1e-6)
    home = robot.machine_home[None]
    postures = _postures(robot)
    for what, loads in (("empty", ()), (f"with {robot.rated_payload:g} kg at the flange", (load,))):
        yield from _held(robot, home, loads, "error", f"at machine home, {what},")
        yield from _held(
            robot, postures, loads, "warning", f"in one of {POSTURES} postures, {what},"
        )


def _held(
    robot: RobotModel,
    q: FloatArray,
    loads: tuple[Load, ...],
    severity: Literal["error", "warning"],
    where: str,
) -> Iterator[Remark]:
    still = np.zeros_like(q)
    torque = np.abs(DynamicsModel(robot, loads).inverse_dynamics(q, still, still)).max(axis=0)
    for i in np.flatnonzero(torque >= robot.envelope_torque[:, 0]):
        yield Remark(
            severity,
            robot.joint_names[i],
            f"{where} gravity needs {torque[i]:.0f} Nm, the drive has "
            f"{robot.envelope_torque[i, 0]:.0f} Nm",
        )


def _speed(robot: RobotModel) -> Iterator[Remark]:
    for i, name in enumerate(robot.joint_names):
        ramp = robot.velocity_max[i] / robot.acceleration_max[i]
        if not 0.02 <= ramp <= 5.0:
            limits = (
                f"{robot.velocity_max[i]:.3g} rad/s and {robot.acceleration_max[i]:.3g} rad/s^2"
            )
            yield Remark(
                "warning",
                name,
                f"reaches full speed in {ramp:.3g} s ({limits}), usual are 0.02 to 5 s",
            )
        needed = robot.acceleration_max[i] * robot.reflected_inertia[i]
        if needed > robot.envelope_torque[i, 0]:
            have = f"the drive has {robot.envelope_torque[i, 0]:.0f} Nm"
            yield Remark(
                "warning",
                name,
                f"the rotor alone needs {needed:.0f} Nm at full acceleration, {have}",
            )


def _controller(robot: RobotModel) -> Iterator[Remark]:
    power = robot.controller
    if power.has_table:
        return
    watts = power.modes[0].controller_watts
    counted = (
        f"{watts:g} W while it stands" if watts else "no watts of its own: energies leave it out"
    )
    yield Remark(
        "note", "controller", f"without a table of power modes, pauses stay on motors; {counted}"
    )


def _wrist(robot: RobotModel) -> Iterator[Remark]:
    if robot.coupled:
        yield Remark(
            "warning",
            "wrist_coupling",
            "is counted by ir energy fit; plans and the simulated robot leave it out",
        )


def _marks(robot: RobotModel) -> Iterator[Remark]:
    count = Counter(robot.marks.values())
    if count["L"]:
        guessed = sorted(place for place, mark in robot.marks.items() if mark == "L")
        listed = ", ".join(guessed[:8]) + (
            f" and {len(guessed) - 8} more" if len(guessed) > 8 else ""
        )
        total = sum(count.values())
        yield Remark(
            "note", "estimates", f"{count['L']} of {total} figures are estimates: {listed}"
        )


COLUMNS = {
    "robot": ("robot", text),
    "title": ("maker and model", text),
    "joints": ("joints", text),
    "payload": ("payload kg", number(0)),
    "mass": ("arm kg", number(0)),
    "modes": ("power modes", text),
}


def add_list(listing: argparse.ArgumentParser) -> None:
    """Arguments of `ir robot list`."""
    add_formats(listing)
    listing.set_defaults(run=run_list)


def add_check(check: argparse.ArgumentParser) -> None:
    """Arguments of `ir robot check`."""
    check.add_argument(
        "robot", metavar="ROBOT", help="a robot file, or the name of a bundled robot"
    )
    add_formats(check, comma=False)
    check.set_defaults(run=run_check)


def add_new(new: argparse.ArgumentParser) -> None:
    """Arguments of `ir robot new`."""
    new.add_argument(
        "--template", action="store_true", help="print an empty sheet of drive figures, and end"
    )
    new.add_argument(
        "--urdf", metavar="FILE", help="how the arm is built: links, joints, masses, shapes"
    )
    new.add_argument("--drives", metavar="FILE", help="what the URDF does not say; see --template")
    output = new.add_argument(
        "-o", "--output", metavar="FILE", default="robot.yaml", help="robot file (robot.yaml)"
    )
    add_renamed(new, "--out", output)
    new.add_argument("--tip", default="", metavar="LINK", help="link at the flange (flange, tool0)")
    words = "folder below which package://NAME/.. is found (that of the URDF and those above)"
    new.add_argument("--packages", default="", metavar="FOLDER", help=words)
    new.set_defaults(run=run_new)


def run_new(arguments: argparse.Namespace) -> int:
    """Write a robot file, or print the empty sheet."""
    from ir_description.files.making import TEMPLATE

    if arguments.template:
        sys.stdout.write(TEMPLATE)
        return 0
    if not arguments.urdf or not arguments.drives:
        raise InputError(
            "give --urdf FILE and --drives FILE; ir robot new --template prints an empty sheet"
        )
    from ir_cli.robot_from_urdf import write_robot

    packages = Path(arguments.packages) if arguments.packages else None
    urdf, drives, out = (
        Path(name) for name in (arguments.urdf, arguments.drives, arguments.output)
    )
    write_robot(urdf, drives, arguments.tip, packages, out)
    return 0


def run_check(arguments: argparse.Namespace) -> int:
    """Print all errors of a file, else remarks on the robot; exit code 1 where it can't be used."""
    robot = _readable(arguments.robot)
    if robot is None:
        return 1

    remarks = remarks_on(robot)
    if arguments.json:
        print_json({"robot": robot.name, "remarks": [remark._asdict() for remark in remarks]})
    else:
        sys.stdout.write(
            f"robot {robot.name}: {robot.title or 'without a title'}, {robot.n} axes, "
        )
        sys.stdout.write(f"{robot.rated_payload:g} kg, {len(robot.capsules)} capsules\n")
        for remark in remarks:
            sys.stdout.write(f"{remark.severity}: {remark.subject}: {remark.sentence}\n")
    return 1 if any(remark.severity == "error" for remark in remarks) else 0


def _readable(name: str) -> RobotModel | None:
    """The robot, or None when all errors of its file have been printed."""
    try:
        return robot_named(name)
    except UnknownNameError as error:
        raise InputError(unknown_name("robot", name[:80], error.known, "ir robot list")) from error
    except DescriptionFileError as error:
        found = (robot_file_errors(Path(name)) if is_path(name) else ()) or (error,)
        for each in found:
            sys.stderr.write(f"ir: {each}\n")
        sys.stderr.write(f"ir: {len(found)} error{'s' if len(found) > 1 else ''}\n")
        return None


def run_list(arguments: argparse.Namespace) -> int:
    """Print the robots."""
    rows: list[Row] = [
        {
            "robot": name,
            "title": (robot := load_robot(name)).title,
            "joints": robot.n,
            "payload": robot.rated_payload,
            "mass": float(robot.link_mass.sum()),
            "modes": len(robot.controller.modes) if robot.controller.has_table else "none",
        }
        for name in bundled_robots()
    ]
    if arguments.json:
        print_json({"robots": rows})
    elif arguments.csv:
        print_csv(rows)
    else:
        print_table(rows, COLUMNS)
    return 0
