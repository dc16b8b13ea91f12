"""Remarks on a robot's data, before anything is planned with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from ir_cli.self_pairs import kept_sentences
from ir_description import Load, RobotModel
from ir_kernels import (
    Chain,
    CollisionModel,
    DynamicsModel,
    KernelError,
    inverse_kinematics,
)
from ir_kernels.inverse_kinematics import SearchedIk, ThreeParallelIk
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_kernels.wrist_geometry import arm_lines
from ir_msgs_py.options import DEFAULT_SAFETY_DISTANCE
from ir_values.arrays import FloatArray

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
    except KernelError as error:
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
    kept = _kept(robot, model)
    for z in np.flatnonzero(distance <= kept):
        pair = model.pairs[int(z)]
        depth = 1e3 * float(distance[z])
        yield Remark(
            "error",
            "machine_home_deg",
            f"{pair.body_a} and {pair.body_b} are {depth:.1f} mm apart there, must be above "
            f"{1e3 * kept[z]:g} mm: choose another posture, or smaller capsules",
        )


def _kept(robot: RobotModel, model: CollisionModel) -> FloatArray:
    """What pairs (Z,) must keep [m]."""
    usual = DEFAULT_SAFETY_DISTANCE
    own = {frozenset(each[:2]): each.distance for each in robot.reduced_distances}
    return np.array([min(usual, own.get(frozenset((a, b)), usual)) for _, a, b in model.pairs])


def _postures(robot: RobotModel) -> FloatArray:
    """Random ones (N, n)."""
    return np.random.default_rng(0).uniform(
        robot.position_min, robot.position_max, (POSTURES, robot.n)
    )


def _near_itself(robot: RobotModel, chain: Chain) -> Iterator[Remark]:
    """Pairs of links that leave few postures to plan in."""
    model = CollisionModel(chain, robot.capsules, (), robot.self_pairs)
    near = (
        (model.distances(_postures(robot)) <= _kept(robot, model)).mean(axis=0)
        if robot.self_pairs
        else np.zeros(0)
    )
    for sentence in kept_sentences(robot.reduced_distances, robot.capsules):
        yield Remark("note", "self_pairs", sentence)
    for z in np.flatnonzero(near > NEAR):
        pair = model.pairs[int(z)]
        share = 100.0 * near[z]
        often = f"{1e3 * DEFAULT_SAFETY_DISTANCE:g} mm in {share:.0f} % of {POSTURES} postures"
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
    """Joints with an unusual ramp to full speed, or a rotor that needs more than its drive."""
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
    turns = robot.motor_turns - np.eye(robot.n)
    pairs = [f"motor {i + 1} with axis {j + 1}" for i, j in np.argwhere(turns).tolist()]
    if pairs:
        said = f"turning {', '.join(pairs)}: torques, limits and losses are those of the motors"
        yield Remark("note", "wrist_coupling", said)


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
