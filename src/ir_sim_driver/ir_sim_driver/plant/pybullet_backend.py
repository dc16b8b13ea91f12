"""The robot in PyBullet, driven by motor torques within the envelope. The only file that knows PyBullet.

Rotor inertia is up to 4000 times a link's own and can neither be fed back as a torque (it diverges in six
steps) nor be added to the links. So every step solves qdd = (H + J_r)^-1 (tau - h - friction +
counterbalance) and applies H qdd + h to the links: exact, and without saturation H is not even needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ir_description import Load, RobotModel
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.errors import BackendError
from ir_sim_driver.plant.backend import STANDING, Work
from ir_sim_driver.plant.bullet_inertia import ATTEMPTS, nudged, solid
from ir_sim_driver.plant.control import CommandFollower, ControlSettings
from ir_sim_driver.plant.drivetrain import Drivetrain

GRAVITY = 9.80665
BRAKE_FACTOR = 1.5
"""Torque of a mechanical brake over the joint's largest motor torque (an estimate; no public figure)."""
SPEED_GUARD = 50.0  # rad/s that no joint reaches: beyond it the physics has diverged
_CHUNK = 4096  # steps whose work is kept when nobody asks for it


class PyBulletBackend:
    """Implements Backend for `robot` standing at `base_pose` (4, 4).

    urdf: makes the URDF text of the robot with a tuple of loads. Raises BackendError when PyBullet is missing
    or has diverged.
    """

    def __init__(
        self,
        robot: RobotModel,
        dt: float,
        urdf: Callable[[RobotModel, tuple[Load, ...]], str],
        base_pose: FloatArray | None = None,
        control: ControlSettings | None = None,
    ) -> None:
        # the base stays at the origin and gravity turns instead: Bullet's inverse dynamics know no base pose
        self._base: FloatArray = np.eye(4) if base_pose is None else np.array(base_pose)
        self._gravity = (self._base[:3, :3].T @ np.array([0.0, 0.0, -GRAVITY])).tolist()
        self._bullet, self._client = _pybullet(), -1
        self._robot, self._dt, self._urdf = robot, dt, urdf
        self._n = len(robot.joint_names)
        self._drives = Drivetrain(robot)
        self._follower = CommandFollower(dt, control)
        self._motor_torque: FloatArray = np.array(robot.envelope_torque)[:, 0]
        self._brake_torque: FloatArray = BRAKE_FACTOR * self._motor_torque
        self._zeros = [0.0] * self._n
        self._still: FloatArray = np.zeros(self._n)
        self.disturbance: FloatArray | None = None
        self.torque, self.saturated = self._still, False
        self.q: FloatArray = np.array(robot.machine_home, dtype=np.float64)
        self.qd = self._still
        self._speed: FloatArray = self._still
        self._speeds: list[FloatArray] = []
        self._torques: list[FloatArray] = []
        self._loads: tuple[Load, ...] = ()
        self._stale = False  # whether Bullet's state is older than ours
        self.set_load(())
        self.reset(self.q)

    def close(self) -> None:
        """Let go of the physics server."""
        self._bullet.disconnect(physicsClientId=self._client)

    @property
    def standing(self) -> bool:
        """Whether the robot stands."""
        return all(-STANDING < x < STANDING for x in self.qd.tolist())

    def reset(self, q: FloatArray) -> None:
        """Stand still at q; starts the physics server again when it is gone."""
        if not self._bullet.isConnected(self._client):
            self.set_load(self._loads)
        self.q, self.qd, self._speed = np.array(q, dtype=np.float64), self._still, self._still
        self._follower.reset(self.q)
        self._write_state()

    def set_load(self, loads: Sequence[Load]) -> None:
        """Rebuild the robot with these loads, in the same motion. Raises BackendError.

        Bullet refuses an inertia that rounding has left unsymmetrical by one bit: then one is tried that
        differs by parts in a billion.
        """
        bodies = [solid(load) for load in loads]
        for attempt in range(ATTEMPTS):
            self._loads = tuple(nudged(load, attempt) for load in bodies)
            self._build()
            try:
                self.bias()
                return
            except BackendError:
                continue
        names = ", ".join(load.name for load in loads)
        raise BackendError(f"PyBullet cannot compute with the inertia of {names or 'the robot'}")

    def _build(self) -> None:
        """Make a new server (a removed body's dynamics live on in the old one), or keep the old one."""
        text, old = self._urdf(self._robot, self._loads), self._client
        self._client = _connect(self._bullet, self._dt, self._gravity)
        try:
            self._body = self._load(text)
        except (OSError, BackendError) as error:
            self._bullet.disconnect(physicsClientId=self._client)
            self._client = old
            raise BackendError(f"PyBullet can't be given the robot: {error}") from error
        if self._bullet.isConnected(old):
            self._bullet.disconnect(physicsClientId=old)
        self._prepare()

    def _load(self, text: str) -> int:
        """The body of a URDF."""
        file = os.memfd_create("robot.urdf")  # a full or read-only disk is no reason to have no robot
        try:
            os.write(file, text.encode())
            path, flags = f"/proc/self/fd/{file}", self._bullet.URDF_USE_INERTIA_FROM_FILE
            return int(self._call(self._bullet.loadURDF, path, useFixedBase=True, flags=flags))
        finally:
            os.close(file)

    def _prepare(self) -> None:
        """Take from the body what Bullet adds: damping, collisions, motors."""
        bullet, client = self._bullet, self._client
        undamped = dict.fromkeys(("linearDamping", "angularDamping", "jointDamping"), 0.0)
        self._joints = self._movable_joints()
        for link in range(-1, bullet.getNumJoints(self._body, physicsClientId=client)):
            bullet.changeDynamics(self._body, link, **undamped, physicsClientId=client)
            bullet.setCollisionFilterGroupMask(self._body, link, 0, 0, physicsClientId=client)
        for joint in self._joints:  # the built-in motors off
            bullet.setJointMotorControl2(
                self._body, joint, bullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client
            )
        self._write_state()

    def track(self, q_next: FloatArray) -> None:
        """Follow the command with the torque that the envelope allows."""
        if self._stale:
            self._write_state()
        speed, drives = self._speed, self._drives
        qdd = self._follower.acceleration(q_next, self.q, speed)
        now = speed + (0.5 * self._dt) * qdd  # the state's speed lags half a step: explicit steps of Bullet
        links = self._inverse_dynamics(qdd)
        resistance = drives.resistance(self.q, now)
        torque, cut = drives.limited(links + drives.rotor_inertia * qdd + resistance, now)
        if cut or self.disturbance is not None:
            links, qdd = self._driven(torque, resistance)
        self.torque, self.saturated = torque, cut
        self._advance(links)

    def coast(self) -> None:
        """Fall and roll on as gravity, friction and counterbalance will have it."""
        if self._stale:
            self._write_state()
        links, _ = self._driven(self._still, self._drives.resistance(self.q, self._speed))
        self.torque, self.saturated = self._still, False
        self._advance(links)
        self._follower.reset(self.q)

    def halt(self) -> None:
        """Brake with the largest motor torque: a motor that brakes has it at any speed."""
        self.torque = self._stop(self._motor_torque)

    def brake(self) -> None:
        """Brake with the mechanical brakes."""
        self._stop(self._brake_torque)

    def _stop(self, most: FloatArray) -> FloatArray:
        """Take at most this torque (n,) to stop each joint within this step; returns it."""
        resistance = self._drives.resistance(self.q, self._still)
        stopping = self._speed * (-1.0 / self._dt)
        links = self._inverse_dynamics(stopping)
        wanted = links + self._drives.rotor_inertia * stopping + resistance
        torque: FloatArray = np.clip(wanted, -most, most)
        if (torque != wanted).any() or self.disturbance is not None:
            links, _ = self._driven(torque, resistance)
        self.torque, self.saturated = self._still, False
        self._advance(links)
        self._follower.reset(self.q)
        return torque

    def rest(self) -> None:
        """Stay where the closed brakes hold the robot."""
        if self._speed.any():
            self._speed = self.qd = self._still
            self._follower.reset(self.q)
            self._stale = True
        self.torque, self.saturated = self._still, False
        self._speeds.append(self._still)
        self._torques.append(self._still)

    def work(self) -> Work:
        """Speed and torque of every step since the last call."""
        shape = (len(self._speeds), self._n)
        work = Work(np.array(self._speeds).reshape(shape), np.array(self._torques).reshape(shape))
        self._speeds.clear()
        self._torques.clear()
        return work

    def mass_matrix(self) -> FloatArray:
        """H (n, n) at the present state, without rotor inertia."""
        H = self._call(self._bullet.calculateMassMatrix, self._body, self.q.tolist())
        return np.array(H, dtype=np.float64)

    def bias(self) -> FloatArray:
        """h = C qd + g (n,) at the present state."""
        return self._inverse_dynamics(self._still)

    def link_com_position(self, link: int) -> FloatArray:
        """Centre of mass (3,) of link 1..n in the world [m]: Bullet has it in double precision."""
        state = self._bullet.getLinkState(
            self._body, self._joints[link - 1], computeForwardKinematics=True, physicsClientId=self._client
        )
        position: FloatArray = self._base[:3, :3] @ np.array(state[0]) + self._base[:3, 3]
        return position

    def _driven(self, torque: FloatArray, resistance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Torque on the links and acceleration under motor torque and disturbance."""
        H, h = self.mass_matrix(), self.bias()
        outer = torque - h - resistance
        if self.disturbance is not None:
            outer = outer + self.disturbance
        qdd = np.asarray(np.linalg.solve(H + np.diag(self._drives.rotor_inertia), outer), dtype=np.float64)
        return H @ qdd + h, qdd

    def _inverse_dynamics(self, qdd: FloatArray) -> FloatArray:
        result = self._call(
            self._bullet.calculateInverseDynamics,
            self._body,
            self.q.tolist(),
            self._speed.tolist(),
            qdd.tolist(),
        )
        return np.array(result)

    def _call(self, function: Any, *arguments: Any, **more: Any) -> Any:
        try:
            return function(*arguments, physicsClientId=self._client, **more)
        except (self._bullet.error, SystemError, ValueError, TypeError) as error:
            raise BackendError(f"PyBullet failed: {error}") from error  # it raises whatever C leaves behind

    def _advance(self, links: FloatArray) -> None:
        bullet, call = self._bullet, self._call
        call(
            bullet.setJointMotorControlArray,
            self._body,
            self._joints,
            bullet.TORQUE_CONTROL,
            forces=links.tolist(),
        )
        call(bullet.stepSimulation)
        states = call(bullet.getJointStates, self._body, self._joints)
        before = self._speed
        speeds = [state[1] for state in states]
        if not all(-SPEED_GUARD < x < SPEED_GUARD for x in speeds):  # NaN does not pass either
            raise BackendError(f"the physics has diverged: a joint moves faster than {SPEED_GUARD:g} rad/s")
        speed = np.array(speeds)
        self.q, self._speed = np.array([state[0] for state in states]), speed
        half = 0.5 * (speed - before)
        self.qd = speed + half
        self._speeds.append(before + half)
        self._torques.append(self.torque)
        if len(self._speeds) > _CHUNK:  # nobody reads the work: keep the memory bounded
            del self._speeds[:_CHUNK], self._torques[:_CHUNK]

    def _write_state(self) -> None:
        self._stale = False
        for joint, q, speed in zip(self._joints, self.q.tolist(), self._speed.tolist(), strict=True):
            self._call(self._bullet.resetJointState, self._body, joint, q, speed)

    def _movable_joints(self) -> list[int]:
        by_name = {}
        for joint in range(self._bullet.getNumJoints(self._body, physicsClientId=self._client)):
            info = self._bullet.getJointInfo(self._body, joint, physicsClientId=self._client)
            by_name[info[1].decode()] = joint
        return [by_name[name] for name in self._robot.joint_names]


def _pybullet() -> Any:
    try:
        import pybullet  # a missing PyBullet is reported when it is wanted
    except ImportError as error:
        raise BackendError(f"PyBullet is not installed ({error}): use backend ideal") from error
    return pybullet


def _connect(bullet: Any, dt: float, gravity: list[float]) -> int:
    client = int(bullet.connect(bullet.DIRECT))
    if client < 0:
        raise BackendError("PyBullet offers no physics server")
    bullet.setGravity(*gravity, physicsClientId=client)
    bullet.setTimeStep(dt, physicsClientId=client)
    return client
