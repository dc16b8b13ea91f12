"""A robot that tracks exactly; torques come from the dynamics model, computed for many steps at once.

For tests of everything around the physics, and for long simulated shifts. A disturbance has no effect on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from ir_kernels.dynamics import DynamicsModel

from ir_sim_driver.arrays import Array
from ir_sim_driver.backend import Work

BRAKE_FACTOR = 2.0
"""Deceleration of the mechanical brakes over the joint's acceleration limit."""


class IdealBackend:
    """Implements Backend without physics, for `robot` standing at `base_pose` (4, 4)."""

    def __init__(self, robot: Any, dt: float, base_pose: Array | None = None) -> None:
        self._robot, self._dt = robot, dt
        self._base_pose = np.eye(4) if base_pose is None else base_pose
        self._brake_step: Array = BRAKE_FACTOR * dt * np.array(robot.acceleration_max)
        self.disturbance: Array | None = None
        self._rows: list[tuple[Array, Array, Array] | None] = []
        n = len(robot.joint_names)
        self._last: Array = np.zeros(n)
        self._speeds: Array = np.empty((0, n))
        self._torques: Array = np.empty((0, n))
        self.set_load(())
        self.reset(np.array(robot.machine_home))

    def reset(self, q: Array) -> None:
        """Stand still at q."""
        self.q: Array = np.array(q, dtype=np.float64)
        self.qd: Array = np.zeros(len(self.q))
        self._speed: Array = self.qd

    def set_load(self, loads: Sequence[Any]) -> None:
        """Carry these loads."""
        if self._rows:
            self._settle()
        self._dynamics = DynamicsModel(self._robot, tuple(loads), self._base_pose)

    def track(self, q_next: Array) -> None:
        """Be at q_next after the step."""
        speed = (q_next - self.q) / self._dt
        qdd = (speed - self._speed) / self._dt
        self._rows.append((self.q, 0.5 * (speed + self._speed), qdd))
        self.q, self._speed = q_next, speed
        self.qd = speed + (0.5 * self._dt) * qdd

    def brake(self) -> None:
        """Slow every joint down by what its brake can do in one step."""
        self._speed = np.sign(self._speed) * np.maximum(np.abs(self._speed) - self._brake_step, 0.0)
        self.qd = self._speed
        self.q = self.q + self._dt * self._speed
        self._rows.append(None)

    def rest(self) -> None:
        """Stay."""
        self._speed = self.qd = np.zeros(len(self.q))
        self._rows.append(None)

    @property
    def torque(self) -> Array:
        """Motor torque of the last step."""
        self._settle()
        return self._last

    def work(self) -> Work:
        """Torques of the steps since the last call."""
        self._settle()
        speed, torque = self._speeds, self._torques
        self._speeds = self._torques = np.empty((0, len(self.q)))
        return Work(speed, torque)

    def _settle(self) -> None:
        n = len(self.q)
        if not self._rows:
            return
        driven = [k for k, row in enumerate(self._rows) if row is not None]
        speed, torque = np.zeros((2, len(self._rows), n))
        if driven:
            q, qd, qdd = (np.array(part) for part in zip(*filter(None, self._rows), strict=True))
            speed[driven] = qd
            torque[driven] = self._dynamics.inverse_dynamics(q, qd, qdd)
        self._rows.clear()
        self._last = torque[-1]
        if self._speeds.size:
            speed, torque = np.vstack((self._speeds, speed)), np.vstack((self._torques, torque))
        self._speeds, self._torques = speed, torque
