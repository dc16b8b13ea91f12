"""The port between the controller and a robot, and what a robot did with its motors.

Five kinds of steps of length dt: the motors follow a command (`track`) or stop the robot (`halt`),
nothing but gravity and friction acts (`coast`), the mechanical brakes act (`brake`), or the brakes
are closed and nothing moves (`rest`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from ir_description import Load
from ir_values.arrays import FloatArray

STANDING = 1e-3
"""Speed [rad/s] below which a joint stands."""


class MotorWork(NamedTuple):
    """What the motors did in K steps: their speed (K, n) [rad/s] in the middle of the step, torque
    (K, n) [Nm], both seen at the joint.
    """

    speed: FloatArray
    torque: FloatArray


class Backend(Protocol):
    """A robot of n joints that is stepped.

    q (n,): present position [rad].
    disturbance (n,) or None: outside torque [Nm] that acts in every step until it is changed.
    """

    q: FloatArray
    disturbance: FloatArray | None

    @property
    def qd(self) -> FloatArray:
        """Present speed (n,) [rad/s]."""

    @property
    def standing(self) -> bool:
        """Whether no joint moves faster than STANDING."""

    @property
    def torque(self) -> FloatArray:
        """Motor torque (n,) [Nm] of the last step."""

    @property
    def saturated(self) -> bool:
        """Whether a motor could not give the torque that the command of the last step needed."""

    def close(self) -> None:
        """Let go of what this process holds for it."""

    def reset(self, q: FloatArray) -> None:
        """Stand still at q (n,), commanded to stay there."""

    @property
    def temperature(self) -> FloatArray | None:
        """Of the gears (n,) [deg C]; None where there are none."""

    def set_load(self, loads: Sequence[Load], declared: Sequence[Load] | None = None) -> None:
        """Carry these loads (ir_description Load, in the last link's frame) from now on; the
        controller takes them for the declared ones, where these are given.
        """

    def track(self, q_next: FloatArray) -> None:
        """Make a step of dt: the motors follow the command, which is q_next (n,) at the end of the
        step.
        """

    def coast(self) -> None:
        """Make a step of dt without motor torque, the mechanical brakes still open."""

    def halt(self) -> None:
        """Make a step of dt: the motors stop each joint as hard as they can, off any path."""

    def brake(self) -> None:
        """Make a step of dt without motor torque, the mechanical brakes closing."""

    def rest(self) -> None:
        """Make a step of dt with closed brakes: nothing moves, no torque."""

    def work(self) -> MotorWork:
        """What the motors did since the last call."""
