"""Computed torque with PD: the acceleration that brings the robot back onto the command.

Command and robot are compared on the same grid of steps: speed is the difference of two commands,
acceleration the difference of two speeds. The command's velocity and acceleration feed forward exactly,
whatever its path time does, and there is nothing to differentiate by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.settings import check_settings, setting


@dataclass(frozen=True)
class ControlSettings:
    """Gains of the position loop; the frequency is bounded by what a 1 kHz loop can do."""

    natural_frequency: float = setting(
        100.0,
        "Natural frequency of the position error.",
        unit="rad/s",
        minimum=1.0,
        maximum=300.0,
        read_only=True,
    )
    damping: float = setting(1.0, "Damping of the position error.", minimum=0.3, maximum=2.0, read_only=True)

    def __post_init__(self) -> None:
        check_settings(self)


class CommandFollower:
    """Turns commands (n,), one per step of dt [s], into wanted accelerations (n,)."""

    def __init__(self, dt: float, settings: ControlSettings | None = None) -> None:
        settings = settings or ControlSettings()
        self._per_dt = 1.0 / dt
        self._kp = settings.natural_frequency**2
        self._kd = 2.0 * settings.damping * settings.natural_frequency

    def reset(self, q: FloatArray) -> None:
        """Start over with a command that stands at q."""
        self.command: FloatArray = q.copy()
        self._speed: FloatArray = np.zeros(len(q))

    def acceleration(self, q_next: FloatArray, q: FloatArray, qd: FloatArray) -> FloatArray:
        """Acceleration (n,) for the step that ends with the command q_next; the robot is at q, qd now."""
        speed = (q_next - self.command) * self._per_dt
        wanted: FloatArray = (
            (speed - self._speed) * self._per_dt
            + self._kd * (self._speed - qd)
            + self._kp * (self.command - q)
        )
        self.command, self._speed = q_next, speed
        return wanted
