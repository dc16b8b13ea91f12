"""The arm with its loads as rigid bodies in PyBullet. The only file that knows PyBullet."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from ir_description import Load, RobotModel
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.errors import BackendError
from ir_sim_driver.plant.bullet_bodies import bodies_of, urdf_of

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
        self._errors = (
            self._bullet.error,
            SystemError,
            ValueError,
            TypeError,
        )  # it raises what C leaves
        self._robot = robot
        self._dt = dt
        self._loads: tuple[Load, ...] = ()
        self._still = [0.0] * robot.n
        self._joints = list(range(robot.n))

    def close(self) -> None:
        """Let go of the physics server."""
        self._bullet.disconnect(physicsClientId=self._client)

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
        """Make a step with these torques on the links: position (n,), and speed (n,) over the
        step.
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
        if self._bullet.isConnected(old):
            self._bullet.disconnect(physicsClientId=old)
        self._prepare()

    def _load(self, text: str) -> int:
        """The body of a URDF."""
        file = os.memfd_create(
            "robot.urdf"
        )  # a full or read-only disk is no reason to have no robot
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


def _connect(bullet: Any, dt: float, gravity: list[float]) -> int:
    client = int(bullet.connect(bullet.DIRECT))
    if client < 0:
        raise BackendError("PyBullet offers no physics server")
    bullet.setGravity(*gravity, physicsClientId=client)
    bullet.setTimeStep(dt, physicsClientId=client)
    return client
