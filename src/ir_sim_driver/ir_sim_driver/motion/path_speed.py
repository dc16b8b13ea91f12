"""The speed along the path: scaling, hold and stop brake here, so that they never leave the path.

With s the path time, qdd = q'' sd^2 + q' sdd: the limits of acceleration and torque bound sdd.
"""

from __future__ import annotations

import math

import numpy as np

from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.motion.path import Motion

_TINY = 1e-12


class PathSpeed:
    """Speed sd of the path time, from 0 to 1 and towards `target`.

    dynamics: an ir_kernels DynamicsModel (torques along the path); acceleration_max (n,); stop_time
    [s]: the shortest stop from full speed.
    """

    def __init__(
        self, dynamics: DynamicsModel, acceleration_max: FloatArray, stop_time: float, dt: float
    ) -> None:
        self.dynamics = dynamics
        self._limit = acceleration_max
        self._rate = 1.0 / stop_time
        self._dt = dt
        self.value = 0.0

    def set_stop_time(self, stop_time: float) -> None:
        """Take another shortest stop [s]."""
        self._rate = 1.0 / stop_time

    def advance(self, target: float, motion: Motion) -> float:
        """Step towards another target; the path time [s] covered. motion: at the present path
        time.
        """
        before = self.value
        wanted = min(max((target - before) / self._dt, -self._rate), self._rate)
        low, high = self._bounds(motion, wanted < 0.0)
        wanted = min(max(wanted, low), high)
        after = before + wanted * self._dt
        if (wanted < 0.0 and after < target) or (wanted > 0.0 and after > target) or after < 0.0:
            after = target
        self.value = min(max(after, 0.0), 1.0)
        return 0.5 * (before + self.value) * self._dt

    def _bounds(self, motion: Motion, braking: bool) -> tuple[float, float]:
        """Range of sdd within the limits; when it is empty: what exceeds them least while slowing
        down.
        """
        v = motion.qd * self.value
        base = motion.qdd * self.value**2
        low, high = _range(motion.qd, base, self._limit)
        rows = np.array((base, base + motion.qd))
        torque = self.dynamics.inverse_dynamics(
            np.array((motion.q, motion.q)), np.array((v, v)), rows
        )
        limit = self.dynamics.torque_limit(v[None])[0]
        low_t, high_t = _range(torque[1] - torque[0], torque[0], limit)
        low = max(low, low_t)
        high = min(high, high_t)
        if low <= high:
            return low, high
        return (-self._rate, -self._rate) if braking else (0.0, 0.0)


def _range(slope: FloatArray, base: FloatArray, limit: FloatArray) -> tuple[float, float]:
    """Interval of x with |base + slope x| <= limit for all components."""
    low = -math.inf
    high = math.inf
    for k, b, bound in zip(slope.tolist(), base.tolist(), limit.tolist(), strict=True):
        if abs(k) > _TINY:
            one = (-bound - b) / k
            other = (bound - b) / k
            low = max(low, min(one, other))
            high = min(high, max(one, other))
    return low, high
