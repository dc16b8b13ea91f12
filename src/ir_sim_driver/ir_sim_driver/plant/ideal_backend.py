"""A robot that tracks exactly; speeds and torques are computed for many steps at once, from where
it was.

For tests of everything around the physics, and for long simulated shifts. A disturbance has no
effect on it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_description import Load, RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.plant.backend import STANDING, MotorWork
from ir_values.arrays import FloatArray

BRAKE_FACTOR = 2.0
"""Deceleration of the mechanical brakes over the joint's acceleration limit."""


class IdealBackend:
    """Implements Backend without physics, for `robot` standing at `base_pose` (4, 4)."""

    def __init__(self, robot: RobotModel, dt: float, base_pose: FloatArray | None = None) -> None:
        self._robot = robot
        self._dt = dt
        self._base_pose = np.eye(4) if base_pose is None else base_pose
        self._brake_step: FloatArray = BRAKE_FACTOR * dt * np.array(robot.acceleration_max)
        self.disturbance: FloatArray | None = None
        n = len(robot.joint_names)
        self._done = MotorWork(np.empty((0, n)), np.empty((0, n)))
        self._last: FloatArray = np.zeros(n)
        self._dynamics = DynamicsModel(robot, (), self._base_pose)
        self._path: list[FloatArray] = []  # two positions more than unsettled steps
        self._driven: list[bool] = []
        self.reset(np.array(robot.machine_home))

    def close(self) -> None:
        """Nothing is held."""

    def reset(self, q: FloatArray) -> None:
        """Stand still at q (n,) [rad]."""
        self._settle()
        self.q: FloatArray = np.array(q, dtype=np.float64)
        self._before: FloatArray = self.q  # one and two steps ago
        self._earlier: FloatArray = self.q
        self._path = [self.q, self.q]

    @property
    def temperature(self) -> None:
        """It has no gears."""
        return None

    def set_load(self, loads: Sequence[Load], declared: Sequence[Load] | None = None) -> None:
        """Carry these loads; nobody needs to declare them, as nothing has to be controlled."""
        self._settle()
        self._dynamics = DynamicsModel(self._robot, tuple(loads), self._base_pose)

    @property
    def qd(self) -> FloatArray:
        """Speed (n,) [rad/s] now: the last difference and half of its change."""
        last = self.q - self._before
        before = self._before - self._earlier
        return (1.5 / self._dt) * last - (0.5 / self._dt) * before

    @property
    def saturated(self) -> bool:
        """Never: torques follow from what is tracked."""
        return False

    @property
    def standing(self) -> bool:
        """Whether the robot stands."""
        if self.q is self._before:
            return True
        return bool(np.abs(self.q - self._before).max() < STANDING * self._dt)

    def track(self, q_next: FloatArray) -> None:
        """Be at q_next (n,) [rad] after the step."""
        self._go(q_next, True)

    def coast(self) -> None:
        """Fall and roll on as gravity, friction and counterbalance will have it."""
        speed = (self.q - self._before) / self._dt
        free = self._dynamics.forward_dynamics(
            self.q[None], speed[None], np.zeros((1, len(speed)))
        )[0]
        self._go(self.q + self._dt * (speed + self._dt * free), False)

    def halt(self) -> None:
        """Slow every joint down, as the brakes do."""
        self.brake()

    def brake(self) -> None:
        """Slow every joint down by what its brake can do in one step."""
        speed = (self.q - self._before) / self._dt
        slower = np.sign(speed) * np.maximum(np.abs(speed) - self._brake_step, 0.0)
        self._go(self.q + self._dt * slower if slower.any() else self.q, False)

    def rest(self) -> None:
        """Stay."""
        self._go(self.q, False)

    @property
    def torque(self) -> FloatArray:
        """Motor torque (n,) [Nm at the joint] of the last step."""
        self._settle()
        return self._last

    def work(self) -> MotorWork:
        """Torques of the steps since the last call."""
        self._settle()
        done = self._done
        empty = np.empty((0, len(self.q)))
        self._done = MotorWork(empty, empty)
        return done

    def _go(self, q_next: FloatArray, driven: bool) -> None:
        self._earlier = self._before
        self._before = self.q
        self.q = q_next
        self._path.append(q_next)
        self._driven.append(driven)

    def _settle(self) -> None:
        """Compute speeds and torques of the steps that have none yet."""
        if not self._driven:
            return
        q = np.array(self._path)
        steps = np.diff(q, axis=0) / self._dt
        qdd = np.diff(steps, axis=0) / self._dt
        middle = 0.5 * (steps[1:] + steps[:-1])
        driven = np.array(self._driven)[:, None]
        torque = np.where(driven, self._dynamics.inverse_dynamics(q[1:-1], middle, qdd), 0.0)
        self._path = self._path[-2:]
        self._driven = []
        self._last = torque[-1]
        speed = np.where(driven, self._robot.coupling.motors(middle), 0.0)
        if len(self._done.speed):
            speed = np.vstack((self._done.speed, speed))
            torque = np.vstack((self._done.torque, torque))
        self._done = MotorWork(speed, torque)
