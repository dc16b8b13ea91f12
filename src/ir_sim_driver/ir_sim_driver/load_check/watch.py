"""What a movement's load check is made of: instants of it, collected while it is driven."""

from __future__ import annotations

from collections import deque

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.load_check.estimate import Motion
from ir_sim_driver.plant import Backend

_REACH = 3  # looks before and after an instant that its speed and acceleration are taken from
# looks between two instants at first, and instants kept
_EVERY = 16
_MOST = 96
LEAST = 6
"""Instants that a check needs."""


class LoadWatch:
    """Is given the robot every `period` [s] while a movement is driven; keeps few instants of any
    length.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.begin()

    def begin(self) -> None:
        """A movement starts."""
        self._seen: deque[FloatArray] = deque(maxlen=2 * _REACH + 1)
        self._torque: FloatArray | None = None
        self._looks = 0
        self._every = _EVERY
        self._rows: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []

    def look(self, robot: Backend) -> None:
        """Take the robot's position, and now and then its torque."""
        self._seen.append(robot.q)
        phase = self._looks % self._every
        if phase == _REACH:
            self._torque = robot.torque
        elif phase == 2 * _REACH and self._torque is not None:
            first = self._seen[0]
            middle = self._seen[_REACH]
            last = self._seen[-1]
            self._rows.append((first, middle, last, self._torque))
            if len(self._rows) > _MOST:
                del self._rows[::2]
                self._every *= 2
        self._looks += 1

    def motion(self) -> Motion | None:
        """The instants so far; None while they are too few, or not finite, as where the physics
        failed.
        """
        if len(self._rows) < LEAST:
            return None
        first, middle, last, torque = np.ascontiguousarray(np.array(self._rows).swapaxes(0, 1))
        reach = _REACH * self._period
        qd = (last - first) / (2.0 * reach)
        qdd = (last - 2.0 * middle + first) / reach**2
        motion = Motion(middle, qd, qdd, torque)
        return motion if all(np.isfinite(values).all() for values in motion) else None
