"""Torques of a moving arm, by recursion over its rigid bodies; by Pinocchio as a second opinion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from ir_description import Load, RobotModel
from ir_values.arrays import FloatArray

# Torques of a moving arm, one rigid body after another: what each of them asks of every joint
# before it.
#
# Velocities and accelerations go outwards from the base; the force and moment that a body needs are
# projected onto the axes (Kane's method). Nothing here is shared with planner, driver or kernels:
# this is what their torques are compared with.

GRAVITY = 9.80665  # m/s^2, standard


@dataclass(frozen=True, eq=False)
class ArmTorques:
    """What moves the bodies, each (N, n) Nm at the joints, N at a rail: links, loads, rotors, and
    the counterbalance, which helps.
    """

    links: FloatArray
    loads: FloatArray
    rotors: FloatArray
    counterbalance: FloatArray


@dataclass(frozen=True, eq=False)
class _Frame:
    """A link: turn (N, 3, 3), place (N, 3), angular speed and acceleration (N, 3), and the
    acceleration of its origin (N, 3), gravity as an acceleration upwards included.
    """

    turn: FloatArray
    place: FloatArray
    spin: FloatArray
    spin_rate: FloatArray
    push: FloatArray


def arm_torques(
    robot: RobotModel, loads: Sequence[Load], base_pose: FloatArray, motion: FloatArray
) -> ArmTorques:
    """Torques at motion (3, N, n), which is q, qd, qdd, of the robot with loads at base_pose (4,
    4). Loads are bolted to the last link.
    """
    q, qd, qdd = motion
    N, n = q.shape
    axes = np.empty((n, N, 3))
    places = np.empty((n, N, 3))
    links = np.zeros((N, n))
    held = np.zeros((N, n))
    frame = _base(N, np.asarray(base_pose))
    for i in range(n):
        frame, axes[i] = _next(frame, robot, i, q[:, i], qd[:, i], qdd[:, i])
        places[i] = frame.place
        _project(
            links,
            frame,
            robot,
            axes[: i + 1],
            places[: i + 1],
            mass=float(robot.link_mass[i + 1]),
            com=robot.link_com[i + 1],
            inertia=robot.link_inertia[i + 1],
        )
    for load in loads:
        _project(
            held, frame, robot, axes, places, mass=load.mass, com=load.com, inertia=load.inertia
        )
    return ArmTorques(
        links=links,
        loads=held,
        rotors=qdd * robot.reflected_inertia,
        counterbalance=spring_torque(robot, q),
    )


def centre_torques(
    robot: RobotModel, base_pose: FloatArray, motion: FloatArray, directions: FloatArray
) -> FloatArray:
    """Torques (2, n, N, n) per metre at motion (3, N, n) by which each link's centre of mass lies
    farther in its own `directions` (2, n, 3); what grows with its square is left out.
    """
    q, qd, qdd = motion
    N, n = q.shape
    axes = np.empty((n, N, 3))
    places = np.empty((n, N, 3))
    found = np.zeros((len(directions), n, N, n))
    frame = _base(N, np.asarray(base_pose))
    for i in range(n):
        frame, axes[i] = _next(frame, robot, i, q[:, i], qd[:, i], qdd[:, i])
        places[i] = frame.place
        mass = float(robot.link_mass[i + 1])
        inertia = robot.link_inertia[i + 1]
        for own, direction in zip(found, directions[:, i], strict=True):
            for side in (-0.5, 0.5):
                part = np.zeros((N, n))
                centre = robot.link_com[i + 1] + side * direction
                before = (axes[: i + 1], places[: i + 1])
                _project(part, frame, robot, *before, mass, centre, inertia)
                own[i] += np.sign(side) * part
    return found


def _base(N: int, pose: FloatArray) -> _Frame:
    none = np.zeros((N, 3))
    up = np.broadcast_to([0.0, 0.0, GRAVITY], (N, 3))
    turn = np.broadcast_to(pose[:3, :3], (N, 3, 3))
    return _Frame(turn, np.broadcast_to(pose[:3, 3], (N, 3)), none, none, up)


def _next(
    before: _Frame, robot: RobotModel, i: int, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> tuple[_Frame, FloatArray]:
    """The link after joint i, and the joint's axis (N, 3) in the world; a rail is the first."""
    origin = robot.joint_origin[i]
    axis = robot.joint_axis[i]
    arm = before.turn @ origin[:3, 3]
    still = before.turn @ origin[:3, :3]
    if i < robot.base:  # slides on a base that stands
        world = still @ axis
        place = before.place + arm + q[:, None] * world
        push = before.push + qdd[:, None] * world
        return _Frame(still, place, before.spin, before.spin_rate, push), world
    turn = still @ _rotations_about(axis, q)
    world = turn @ axis
    spin = before.spin + qd[:, None] * world
    rate = before.spin_rate + qdd[:, None] * world + np.cross(before.spin, qd[:, None] * world)
    push = before.push + _acceleration_at_end(before.spin, before.spin_rate, arm)
    return _Frame(turn, before.place + arm, spin, rate, push), world


def _rotations_about(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Turns (N, 3, 3) by angles (N,) about an axis (3,)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sin = np.sin(angle)[:, None, None]
    cos = np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + sin * cross + (1.0 - cos) * (cross @ cross))


def _acceleration_at_end(spin: FloatArray, rate: FloatArray, arm: FloatArray) -> FloatArray:
    """Acceleration (N, 3) at the end of an arm (N, 3) that turns, relative to its foot."""
    return np.asarray(np.cross(rate, arm) + np.cross(spin, np.cross(spin, arm)))


def _project(
    torque: FloatArray,
    frame: _Frame,
    robot: RobotModel,
    axes: FloatArray,
    places: FloatArray,
    mass: float,
    com: FloatArray,
    inertia: FloatArray,
) -> None:
    """Add what a body of the frame asks of the joints 0..len(axes) to torque (N, n): the moment
    about those that turn, the force along a rail.
    """
    arm = frame.turn @ com
    force = mass * (frame.push + _acceleration_at_end(frame.spin, frame.spin_rate, arm))
    world = frame.turn @ inertia @ frame.turn.transpose(0, 2, 1)
    momentum = (world @ frame.spin[:, :, None])[:, :, 0]
    moment = (world @ frame.spin_rate[:, :, None])[:, :, 0] + np.cross(frame.spin, momentum)
    centre = frame.place + arm
    for j, (axis, place) in enumerate(zip(axes, places, strict=True)):
        asked = force if j < robot.base else np.cross(centre - place, force) + moment
        torque[:, j] += (asked * axis).sum(axis=1)


def spring_torque(robot: RobotModel, q: FloatArray) -> FloatArray:
    """What the gas spring does about the joints' axes (N, n) Nm: the slope of its energy over the
    angle.

    By the principle of virtual work: force times the change of the rod's length per radian.
    """
    torque = np.zeros_like(q)
    spring = robot.counterbalance
    if spring is None:
        return torque
    eye = spring.rod_eye
    pivot = spring.pivot
    angle = q[:, spring.joint]
    x = eye[0] * np.cos(angle) + eye[1] * np.sin(angle)
    z = eye[1] * np.cos(angle) - eye[0] * np.sin(angle)
    length = np.hypot(x - pivot[0], z - pivot[1])
    lengthening = (z * (x - pivot[0]) - x * (z - pivot[1])) / length  # m per rad
    stroke = spring.piston_area * (length - spring.rod_length_at_charge)
    pressure = spring.charge_pressure * (1.0 - stroke / spring.gas_volume) ** -spring.exponent
    torque[:, spring.joint] = -spring.piston_area * pressure * lengthening
    return torque


# Torques by Pinocchio, where it is installed: a second opinion on those of `arm`.


def available() -> bool:
    """Whether Pinocchio is installed."""
    return find_spec("pinocchio") is not None


def pinocchio_torques(
    robot: RobotModel, loads: Sequence[Load], base_pose: FloatArray, motion: FloatArray
) -> ArmTorques:
    """The same as `arm_torques` at motion (3, N, n); what the loads ask for counts among the
    links.
    """
    import pinocchio

    q, _, qdd = motion
    model = pinocchio.Model()
    parent = 0
    model.gravity.linear = np.asarray(base_pose)[:3, :3].T @ [0.0, 0.0, -GRAVITY]
    for i, (origin, axis) in enumerate(zip(robot.joint_origin, robot.joint_axis, strict=True)):
        place = pinocchio.SE3(origin[:3, :3].copy(), origin[:3, 3].copy())
        kind = "Prismatic" if i < robot.base else "Revolute"
        of_joint = getattr(pinocchio, f"JointModel{kind}Unaligned")
        parent = model.addJoint(parent, of_joint(axis.copy()), place, f"joint_{i}")
        bodies = [(robot.link_mass[i + 1], robot.link_com[i + 1], robot.link_inertia[i + 1])]
        if i == robot.n - 1:
            bodies += [(load.mass, load.com, load.inertia) for load in loads]
        for mass, com, inertia in bodies:
            body = pinocchio.Inertia(float(mass), np.array(com), np.array(inertia))
            model.appendBodyToJoint(parent, body, pinocchio.SE3.Identity())
    data = model.createData()
    torques = []
    for own_q, own_qd, own_qdd in motion.transpose(1, 0, 2):
        torques.append(pinocchio.rnea(model, data, own_q, own_qd, own_qdd).copy())
    return ArmTorques(
        links=np.array(torques).reshape(q.shape),
        loads=np.zeros_like(q),
        rotors=qdd * robot.reflected_inertia,
        counterbalance=spring_torque(robot, q),
    )
