"""The robot in PyBullet: rigid bodies of arm and loads, driven by motor torques."""

from __future__ import annotations

import math
import os
import weakref
from collections.abc import Sequence
from operator import add, sub
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.linalg.lapack import dposv

from ir_description import Load, RobotModel
from ir_sim_driver.errors import BackendError
from ir_sim_driver.plant.backend import STANDING, MotorWork
from ir_sim_driver.plant.drivetrain import Drivetrain, Gears
from ir_sim_driver.plant.plant_parameters import Plant
from ir_sim_driver.plant.servo_control import ControlSettings, ServoControl
from ir_values.arrays import FloatArray

# Bodies: one per link, in its principal axes, its loads merged.
#
# Bullet turns an inertia into its principal axes, moves it to the joint by -m x y and -m y x, and
# refuses what rounding leaves unsymmetrical by 1e-15 kg m^2. Given in principal axes nothing is
# turned; and some mass within parts in a trillion gives the same products in either order.

_ULPS = 1000  # of a figure that are tried, relative 2e-13; one mass in ten is exact
_THICKNESS = 1e-6  # share of the largest principal moment; a thousand times finer than it is known


class PhysicsBody(NamedTuple):
    """A link: mass [kg], centre (3,) [m] and principal moments (3,) [kg m^2] about it in its frame,
    whose pose in that of the link before is pose (4, 4); it turns about axis (3,), on a rail the
    first slides along it.
    """

    mass: float
    com: FloatArray
    moments: FloatArray
    pose: FloatArray
    axis: FloatArray


def bodies_of(robot: RobotModel, loads: Sequence[Load]) -> list[PhysicsBody]:
    """The n bodies that move; the loads (in the last link's frame) are parts of the last one."""
    bodies = []
    before = np.eye(3)
    for i in range(robot.n):
        own = robot.link_mass[i + 1], robot.link_com[i + 1], robot.link_inertia[i + 1]
        carried = loads if i == robot.n - 1 else ()
        mass, com, inertia = _merged(
            [own, *((load.mass, load.com, load.inertia) for load in carried)]
        )
        moments, turn = np.linalg.eigh(inertia)
        turn[:, 0] *= np.linalg.det(turn)
        pose = np.array(robot.joint_origin[i])
        pose[:3, 3] = before.T @ pose[:3, 3]
        pose[:3, :3] = before.T @ pose[:3, :3] @ turn
        axis = _unit(turn.T @ np.asarray(robot.joint_axis[i]))
        com = turn.T @ com
        bodies.append(PhysicsBody(_symmetrical(mass, com), com, _thick(moments), pose, axis))
        before = turn
    return bodies


def urdf_of(robot: RobotModel, bodies: Sequence[PhysicsBody]) -> str:
    """The URDF text of the bodies on a base that is fixed."""
    low = np.array(robot.position_min).tolist()
    high = np.array(robot.position_max).tolist()
    parts = [_link(0, 1.0, np.zeros(3), np.ones(3))]
    for i, body in enumerate(bodies):
        parts.append(_link(i + 1, body.mass, body.com, body.moments))
        kind = "prismatic" if i < robot.base else "revolute"
        origin = _origin(body.pose[:3, 3], _rpy(body.pose[:3, :3]))
        parts.append(
            f'<joint name="{i + 1}" type="{kind}">{origin}'
            f'<parent link="{i}"/><child link="{i + 1}"/><axis xyz="{_numbers_text(body.axis)}"/>'
            f'<limit lower="{low[i]!r}" upper="{high[i]!r}" velocity="0" effort="0"/></joint>'
        )
    return f'<robot name="plant">{"".join(parts)}</robot>'


def _merged(
    parts: Sequence[tuple[float, FloatArray, FloatArray]],
) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre (3,) and inertia (3, 3) about it of rigid bodies, given so each."""
    mass = float(sum(m for m, _, _ in parts))
    com = sum((m * np.asarray(c) for m, c, _ in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for m, c, own in parts:
        off = np.asarray(c) - com
        inertia += np.asarray(own) + m * (off @ off * np.eye(3) - np.outer(off, off))
    return mass, com, 0.5 * (inertia + inertia.T)


def _thick(moments: FloatArray) -> FloatArray:
    """Principal moments (3,), rising, that Bullet does not take for impossible by rounding, and for
    zero then: a flat disc fulfils their triangle inequality with equality.
    """
    if moments[0] + moments[1] - moments[2] > _THICKNESS * moments[2]:
        return moments
    thicker: FloatArray = moments + _THICKNESS * moments[2]
    return thicker


def _unit(axis: FloatArray) -> FloatArray:
    """The axis (3,) with a length of 1 to the last bit, as Bullet has a sentence for any other."""
    axis = axis / np.linalg.norm(axis)
    largest = int(np.abs(axis).argmax())
    for _ in range(_ULPS):
        length = math.sqrt(sum(x * x for x in axis.tolist()))
        if length == 1.0:
            break
        axis[largest] = np.nextafter(axis[largest], 0.0 if length > 1.0 else 2.0 * axis[largest])
    return axis


def _symmetrical(mass: float, com: FloatArray) -> float:
    """The nearest mass above whose products with the coordinates of the centre commute in floating
    point.
    """
    x, y, z = com.tolist()
    for _ in range(_ULPS):
        if all((mass * a) * b == (mass * b) * a for a, b in ((x, y), (x, z), (y, z))):
            break
        mass = math.nextafter(mass, math.inf)
    return mass


def _link(i: int, mass: float, com: FloatArray, moments: FloatArray) -> str:
    ixx, iyy, izz = moments.tolist()
    return (
        f'<link name="{i}"><inertial>{_origin(com, np.zeros(3))}<mass value="{mass!r}"/><inertia '
        f'ixx="{ixx!r}" ixy="0" ixz="0" iyy="{iyy!r}" iyz="0" izz="{izz!r}"/></inertial></link>'
    )


def _origin(xyz: FloatArray, rpy: FloatArray) -> str:
    return f'<origin xyz="{_numbers_text(xyz)}" rpy="{_numbers_text(rpy)}"/>'


def _numbers_text(values: FloatArray) -> str:
    return " ".join(repr(x) for x in values.tolist())


def _rpy(R: FloatArray) -> FloatArray:
    """Roll, pitch, yaw [rad] of a rotation (3, 3). Roll is taken behind yaw, so that next to a
    pitch of 90 degrees, where yaw is hardly known, their sum still is.
    """
    yaw = np.arctan2(R[1, 0], R[0, 0])
    sin = np.sin(yaw)
    cos = np.cos(yaw)
    pitch = np.arctan2(-R[2, 0], cos * R[0, 0] + sin * R[1, 0])
    roll = np.arctan2(sin * R[0, 2] - cos * R[1, 2], cos * R[1, 1] - sin * R[0, 1])
    return np.array((roll, pitch, yaw))


# Arm: joints and loads as rigid bodies in PyBullet.

GRAVITY = 9.80665
SPEED_GUARD = 50.0
"""Speed [rad/s] that all joints together do not reach: beyond it the physics has diverged."""


class BulletArm:
    """Links of `robot` standing at base_pose (4, 4), stepped by dt [s].

    Raises BackendError when PyBullet is missing or has diverged.
    """

    def __init__(self, robot: RobotModel, dt: float, base_pose: FloatArray) -> None:
        # the base stays at the origin and gravity turns instead: Bullet's inverse dynamics know no
        # base pose
        self._base = base_pose
        self._gravity = (base_pose[:3, :3].T @ np.array([0.0, 0.0, -GRAVITY])).tolist()
        self._bullet = _pybullet()
        self._client = -1
        self._release = weakref.finalize(self, _disconnect, self._bullet, self._client)
        # it raises what C leaves
        self._errors = (
            self._bullet.error,
            SystemError,
            ValueError,
            TypeError,
        )
        self._robot = robot
        self._dt = dt
        self._loads: tuple[Load, ...] = ()
        self._still = [0.0] * robot.n
        self._joints = list(range(robot.n))

    def close(self) -> None:
        """Let go of the physics server, of some 30 MB; an arm that is not used any more does it by
        itself.
        """
        self._release()

    def connect_again(self) -> None:
        """Start the physics server again when it is gone."""
        if not self._bullet.isConnected(self._client):
            self.carry(self._loads, self._still)

    def carry(self, loads: Sequence[Load], q: Sequence[float]) -> None:
        """Rebuild the robot with these loads. Raises BackendError where Bullet can't compute with
        it.
        """
        self._loads = tuple(loads)
        self._build(urdf_of(self._robot, bodies_of(self._robot, self._loads)))
        self.inverse_dynamics(q, self._still, self._still)

    def mass_matrix(self, q: Sequence[float]) -> tuple[tuple[float, ...], ...]:
        """Rows of H (n, n) at q, without rotor inertia."""
        try:
            rows: tuple[tuple[float, ...], ...] = self._bullet.calculateMassMatrix(
                self._body, q, physicsClientId=self._client
            )
        except self._errors as error:
            raise _failed(error) from error
        return rows

    def inverse_dynamics(
        self, q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]
    ) -> tuple[float, ...]:
        """Torque H qdd + h (n,) on the links."""
        try:
            torque: tuple[float, ...] = self._bullet.calculateInverseDynamics(
                self._body, q, qd, qdd, physicsClientId=self._client
            )
        except self._errors as error:
            raise _failed(error) from error
        return torque

    def link_com_position(self, link: int) -> FloatArray:
        """Centre of mass (3,) of link 1..n in the world [m], the last one's with its loads.

        Bullet keeps this frame in double precision, the link frame itself only in single.
        """
        state = self._bullet.getLinkState(
            self._body,
            self._joints[link - 1],
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )
        position: FloatArray = self._base[:3, :3] @ np.array(state[0]) + self._base[:3, 3]
        return position

    def write(self, q: Sequence[float], qd: Sequence[float]) -> None:
        """Be at q, moving at qd."""
        for joint, position, speed in zip(self._joints, q, qd, strict=True):
            self._call(self._bullet.resetJointState, self._body, joint, position, speed)

    def advance(self, torque: Sequence[float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Make a step with these torques on the links: position (n,), and speed (n,) over the step.
        Raises BackendError where the physics diverges.
        """
        bullet = self._bullet
        body = self._body
        joints = self._joints
        client = self._client
        try:
            bullet.setJointMotorControlArray(
                body, joints, bullet.TORQUE_CONTROL, forces=torque, physicsClientId=client
            )
            bullet.stepSimulation(physicsClientId=client)
            states = bullet.getJointStates(body, joints, physicsClientId=client)
        except self._errors as error:
            raise _failed(error) from error
        positions, speeds, _, _ = zip(*states, strict=True)
        if not math.hypot(*speeds) < SPEED_GUARD:  # NaN does not pass either
            raise BackendError(
                f"the physics has diverged: joints move faster than {SPEED_GUARD:g} rad/s"
            )
        return positions, speeds

    def _build(self, text: str) -> None:
        """Make a new server: the inverse dynamics of a removed body live on in the old one. Where
        that is not possible the old one stays.
        """
        old = self._client
        self._client = _connect(self._bullet, self._dt, self._gravity)
        try:
            self._body = self._load(text)
        except (OSError, BackendError) as error:
            self._bullet.disconnect(physicsClientId=self._client)
            self._client = old
            raise BackendError(f"PyBullet can't be given the robot: {error}") from error
        if self._client == old:  # that server had gone, and its number is given again
            self._release.detach()
        self._release()
        self._release = weakref.finalize(self, _disconnect, self._bullet, self._client)
        self._prepare()

    def _load(self, text: str) -> int:
        """The body of a URDF."""
        # a full or read-only disk is no reason to have no robot
        file = os.memfd_create("robot.urdf")
        try:
            os.write(file, text.encode())
            path = f"/proc/self/fd/{file}"
            flags = self._bullet.URDF_USE_INERTIA_FROM_FILE
            return int(self._call(self._bullet.loadURDF, path, useFixedBase=True, flags=flags))
        finally:
            os.close(file)

    def _prepare(self) -> None:
        """Take from the body what Bullet adds: damping, collisions, motors."""
        bullet = self._bullet
        client = self._client
        undamped = dict.fromkeys(("linearDamping", "angularDamping", "jointDamping"), 0.0)
        for link in range(-1, bullet.getNumJoints(self._body, physicsClientId=client)):
            bullet.changeDynamics(self._body, link, **undamped, physicsClientId=client)
            bullet.setCollisionFilterGroupMask(self._body, link, 0, 0, physicsClientId=client)
        for joint in self._joints:  # the built-in motors off
            bullet.setJointMotorControl2(
                self._body, joint, bullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client
            )

    def _call(self, function: Any, *arguments: Any, **more: Any) -> Any:
        try:
            return function(*arguments, physicsClientId=self._client, **more)
        except self._errors as error:
            raise _failed(error) from error


def _failed(error: Exception) -> BackendError:
    return BackendError(f"PyBullet failed: {error}")


def _pybullet() -> Any:
    try:
        import pybullet  # a missing PyBullet is reported when it is wanted
    except ImportError as error:
        raise BackendError(f"PyBullet is not installed ({error}): use backend ideal") from error
    return pybullet


def _disconnect(bullet: Any, client: int) -> None:
    if bullet.isConnected(client):
        bullet.disconnect(physicsClientId=client)


def _connect(bullet: Any, dt: float, gravity: list[float]) -> int:
    client = int(bullet.connect(bullet.DIRECT))
    if client < 0:
        raise BackendError("PyBullet offers no physics server")
    bullet.setGravity(*gravity, physicsClientId=client)
    bullet.setTimeStep(dt, physicsClientId=client)
    return client


# Backend: a plant that is driven by the torques of a controller which does not know it.
#
# Rotor inertia is up to 4000 times a link's own and can neither be fed back as a torque (it
# diverges in six steps) nor be added to the links. So every step solves (H + J_r) qdd + h +
# friction - counterbalance = tau for qdd, friction at the speed in the middle of the change (else
# it chatters at rest), and applies H qdd + h to the links.

BRAKE_FACTOR = 1.5
"""Torque of a mechanical brake over the joint's largest motor torque (an estimate; no public
figure).
"""
_CHUNK = 4096  # steps whose work is kept when nobody asks for it
_FRICTION = 1e-6  # Nm to which the friction of a step is found
# steps of Newton's method for it, and with those that surely come nearer
_NEWTON = 4
_ITERATIONS = 16


class PyBulletBackend:
    """Implements Backend for the plant of `model`, the robot as its controller knows it, at
    base_pose (4, 4).

    Raises BackendError when PyBullet is missing or has diverged.
    """

    def __init__(
        self,
        plant: Plant,
        model: RobotModel,
        dt: float,
        base_pose: FloatArray | None = None,
        control: ControlSettings | None = None,
    ) -> None:
        base = np.eye(4) if base_pose is None else np.array(base_pose)
        self._arm = BulletArm(plant.robot, dt, base)
        self._dt = dt
        self._n = len(plant.robot.joint_names)
        self._drives = Drivetrain(plant.robot)
        self._coupling = plant.robot.coupling
        self._gears = Gears(plant.gears, dt)
        self._axes = range(self._n)
        # seen by the motors: H + J_r, and what friction adds
        self._inertia: FloatArray = np.zeros((self._n, self._n))
        self._diagonal = self._inertia.ravel()[:: self._n + 1]
        self._rotor: list[float] = self._drives.rotor_inertia.tolist()
        self._servo = ServoControl(model, dt, base, control)
        self._motor_torque: FloatArray = np.array(plant.robot.envelope_torque)[:, 0]
        self._brake_torque: FloatArray = BRAKE_FACTOR * self._motor_torque
        self._still: FloatArray = np.zeros(self._n)
        self.disturbance: FloatArray | None = None
        self.torque = self._still
        self.saturated = False
        self._rest = [0.0] * self._n
        self._be(np.array(plant.robot.machine_home, dtype=np.float64))
        self._load: Sequence[float] = self._rest  # through the gears to the links in the last step
        self._speeds: list[Sequence[float]] = []
        self._torques: list[FloatArray] = []
        self._stale = False  # whether Bullet's state is older than ours
        self.set_load(())
        self.reset(self.q)

    def close(self) -> None:
        """Let go of the physics server."""
        self._arm.close()

    @property
    def qd(self) -> FloatArray:
        """Present speed (n,) [rad/s]."""
        return np.array(self._now)

    @property
    def standing(self) -> bool:
        """Whether the robot stands."""
        return min(self._now) > -STANDING and max(self._now) < STANDING

    @property
    def temperature(self) -> FloatArray:
        """Of the gears (n,) [deg C]."""
        return self._gears.temperature

    def reset(self, q: FloatArray) -> None:
        """Stand still at q (n,) [rad]; starts the physics server again when it is gone."""
        self._arm.connect_again()
        self._be(np.array(q, dtype=np.float64))
        self._servo.reset(self.q)
        self._write()

    def set_load(self, loads: Sequence[Load], declared: Sequence[Load] | None = None) -> None:
        """Carry these loads, in the same motion. Raises BackendError where Bullet takes none of
        their inertia.
        """
        self._arm.carry(loads, self._at)
        self._servo.declare(loads if declared is None else declared)
        self._write()

    def track(self, q_next: FloatArray) -> None:
        """Follow the command q_next (n,) [rad] with the torque that the envelope allows."""
        if self._stale:
            self._write()
        self.torque, self.saturated = self._servo.torque(q_next, self.q)
        self._drive(self.torque)

    def coast(self) -> None:
        """Fall and roll on as gravity, friction and counterbalance will have it."""
        if self._stale:
            self._write()
        self.torque = self._still
        self.saturated = False
        self._drive(self._still)
        self._servo.reset(self.q)

    def halt(self) -> None:
        """Brake with the largest motor torque: a motor that brakes has it at any speed."""
        self._stop(self._motor_torque, motors=True)

    def brake(self) -> None:
        """Brake with the mechanical brakes."""
        self._stop(self._brake_torque, motors=False)

    def _stop(self, most: FloatArray, motors: bool) -> None:
        """Take at most this torque (n,), of motors or brakes, to stop each joint within this
        step.
        """
        H = self.mass_matrix()
        h = self._bias(self._lagging)
        stopping = np.array(self._lagging) * (-1.0 / self._dt)
        links = H @ stopping + h
        balance = np.array(self._drives.counterbalance(self._at))
        rotors = self._coupling.joint_torque(
            self._drives.rotor_inertia * self._coupling.motors(stopping)
        )
        wanted = self._coupling.motor_torque(links + rotors - balance)
        torque: FloatArray = np.clip(wanted, -most, most)
        self.torque = torque if motors else self._still
        self.saturated = False
        if (torque != wanted).any() or self.disturbance is not None:
            self._drive(torque)
        else:
            self._advance(links.tolist())
        self._servo.reset(self.q)

    def rest(self) -> None:
        """Stay where the closed brakes hold the robot."""
        if any(self._lagging):
            self._be(self.q)
            self._servo.reset(self.q)
            self._stale = True
        self.torque = self._still
        self.saturated = False
        self._gears.cool()
        self._speeds.append(self._rest)
        self._torques.append(self._still)

    def work(self) -> MotorWork:
        """Speed and torque of the motors in every step since the last call."""
        shape = (len(self._speeds), self._n)
        speed = self._coupling.motors(np.array(self._speeds).reshape(shape))
        work = MotorWork(speed, np.array(self._torques).reshape(shape))
        self._speeds.clear()
        self._torques.clear()
        return work

    def mass_matrix(self) -> FloatArray:
        """H (n, n) at the present state, without rotor inertia."""
        return np.array(self._arm.mass_matrix(self._at))

    def bias(self) -> FloatArray:
        """h = C qd + g (n,) at the present state."""
        return self._bias(self._now)

    def link_com_position(self, link: int) -> FloatArray:
        """Centre of mass (3,) of link 1..n in the world [m]."""
        return self._arm.link_com_position(link)

    def required_torque(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Motor torque (n,) [Nm] at the joint for this motion, by the equations that are
        stepped.
        """
        links = self._arm.inverse_dynamics(q.tolist(), qd.tolist(), qdd.tolist())
        arm = np.array(links) - self._drives.counterbalance(q.tolist())
        through = self._coupling.motor_torque(arm)
        speed = self._coupling.motors(qd).tolist()
        friction, _ = self._gears.friction(speed, self._gears.dry(speed, through.tolist()))
        rotors = self._drives.rotor_inertia * self._coupling.motors(qdd)
        torque: FloatArray = through + rotors + friction
        return torque

    def _bias(self, qd: Sequence[float]) -> FloatArray:
        return np.array(self._arm.inverse_dynamics(self._at, qd, self._rest))

    def _be(self, q: FloatArray) -> None:
        """Stand at q (n,)."""
        self.q: FloatArray = q
        self._at: Sequence[float] = q.tolist()
        self._now: Sequence[float] = self._rest
        self._lagging: Sequence[float] = self._rest  # Bullet's speed: it is half a step old

    def _drive(self, torque: FloatArray) -> None:
        """Make a step under this motor torque and the disturbance."""
        arm = self._arm
        q = self._at
        balance = self._drives.counterbalance(q)
        given = self._coupling.joint_torque(torque)
        outer = list(
            map(
                sub,
                map(add, given.tolist(), balance),
                arm.inverse_dynamics(q, self._now, self._rest),
            )
        )
        if self.disturbance is not None:
            outer = list(map(add, outer, self.disturbance.tolist()))
        links = arm.inverse_dynamics(q, self._lagging, self._accelerations(outer))
        self._load = self._of_motors(list(map(sub, links, balance)), torque=True)
        self._advance(links)

    def _accelerations(self, outer: Sequence[float]) -> list[float]:
        """qdd (n,) of a step in which this torque (n,) acts on the joints, and friction at the
        speed in its middle; solved for the motors, to which rotors and friction belong.

        Newton's method: friction counts as linear about the speed of the last iteration.
        """
        gears = self._gears
        lagging = self._of_motors(self._lagging)
        speed = self._of_motors(self._now)
        outer = self._of_motors(outer, torque=True)
        half = 0.5 * self._dt
        rows = self._arm.mass_matrix(self._at)
        if self._coupling.coupled:
            inverse = self._coupling.inverse
            rows = (inverse.T @ np.array(rows) @ inverse).tolist()
        self._inertia[:] = rows
        own = [row[j] + rotor for j, row, rotor in zip(self._axes, rows, self._rotor, strict=True)]
        dry = gears.dry(speed, self._load)
        friction, slope = gears.friction(speed, dry)
        # the state's speed lags half a step: qd is the speed at its position
        for k in range(_ITERATIONS):
            self._diagonal[:] = [m + half * s for m, s in zip(own, slope, strict=True)]
            rest = zip(outer, friction, slope, speed, lagging, strict=True)
            left = [t - f + s * (v - w) for t, f, s, v, w in rest]
            qdd: list[float] = dposv(self._inertia, left)[1].tolist()
            before = speed
            speed = [w + half * a for w, a in zip(lagging, qdd, strict=True)]
            linear = zip(friction, slope, speed, before, strict=True)
            expected = [f + s * (v - u) for f, s, v, u in linear]
            friction, slope = gears.friction(speed, dry, chord=k >= _NEWTON)
            missed = max(map(abs, map(sub, friction, expected)))
            if missed < _FRICTION:
                break
        gears.heat(friction, speed)
        if self._coupling.coupled:
            return cast(list[float], self._coupling.joints(np.array(qdd)).tolist())
        return qdd

    def _of_motors(self, values: Sequence[float], *, torque: bool = False) -> Sequence[float]:
        """What speeds or torques (n,) of the joints are for the motors."""
        if not self._coupling.coupled:
            return values
        convert = self._coupling.motor_torque if torque else self._coupling.motors
        return cast(list[float], convert(np.array(values)).tolist())

    def _advance(self, links: Sequence[float]) -> None:
        """Make a step with these torques (n,) on the links."""
        before = self._lagging
        self._at, self._lagging = self._arm.advance(links)
        self.q = np.array(self._at)
        self._now = [1.5 * v - 0.5 * u for u, v in zip(before, self._lagging, strict=True)]
        self._speeds.append([0.5 * (u + v) for u, v in zip(before, self._lagging, strict=True)])
        self._torques.append(self.torque)
        if len(self._speeds) > _CHUNK:  # nobody reads the work: keep the memory bounded
            del self._speeds[:_CHUNK], self._torques[:_CHUNK]

    def _write(self) -> None:
        self._stale = False
        self._arm.write(self._at, self._lagging)
