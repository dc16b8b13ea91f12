"""Bounds of every joint's motion, and the share of the torque envelope that a motion needs."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ir_kernels import portable
from ir_planner.scene.tool_bounds import UNBOUNDED, ToolBounds
from ir_values.arrays import FloatArray

STILL = 1e-9  # rad: nothing moves


class Dynamics(Protocol):
    """What timing needs of ir_kernels.DynamicsModel."""

    def inverse_dynamics(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Torque (N, n) Nm."""

    def torque_limit(self, qd: FloatArray) -> FloatArray:
        """Torque (N, n) Nm available."""


@dataclass(frozen=True)
class MotionLimits:
    """Bounds per joint (n,): rad/s, rad/s^2, rad/s^3; the share (0, 1] of the torque envelope to
    use, and the share of it that is left to the feedback. tool: bounds of the tool's motion.
    """

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    torque_share: float = 0.98
    torque_reserve: float = 0.0
    tool: ToolBounds = UNBOUNDED

    def scaled(self, velocity: float, acceleration: float) -> "MotionLimits":
        """Bounds times the request's scalings; acceleration scaling holds for the jerk as well,
        none for the tool.
        """
        return MotionLimits(
            self.velocity * velocity,
            self.acceleration * acceleration,
            self.jerk * acceleration,
            self.torque_share,
            self.torque_reserve,
            self.tool,
        )

    def for_speed(self, share: float) -> "MotionLimits":
        """Tighter bounds: a motion within them keeps the true ones at 1 / share times its speed;
        share in (0, 1].
        """
        return MotionLimits(
            self.velocity * share,
            self.acceleration * (share * share),
            self.jerk * portable.power(share, 3),
            self.torque_share * (share * share),
            self.torque_reserve,
            self.tool.for_speed(share),
        )

    def with_torque_share(self, share: float) -> "MotionLimits":
        """The same bounds with another share of the torque that the reserve leaves."""
        return replace(self, torque_share=share * (1.0 - self.torque_reserve))


def torque_use(dynamics: Dynamics, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
    """Share (N, n) of the torque envelope that a motion needs."""
    return np.abs(dynamics.inverse_dynamics(q, qd, qdd)) / dynamics.torque_limit(qd)


def lasting_longer(
    limits: MotionLimits,
    velocity: FloatArray,
    acceleration: FloatArray,
    jerk: FloatArray,
    torque: FloatArray,
) -> FloatArray:
    """By what factor (...) each part of a motion should last longer, from its largest values (...,
    n); at most 1: within the limits. torque: share of the envelope.

    When a motion lasts f times as long on the same path, its velocities fall by f, its
    accelerations by f^2 and its jerks by f^3. The part of the torque that accelerates falls by f^2;
    gravity stays, so for torque the factor is an estimate, to be applied again.
    """
    factors: FloatArray = np.maximum.reduce(
        [
            (velocity / limits.velocity).max(axis=-1),
            np.sqrt((acceleration / limits.acceleration).max(axis=-1)),
            portable.cbrt((jerk / limits.jerk).max(axis=-1)),
            np.sqrt(torque.max(axis=-1) / limits.torque_share),
        ]
    )
    return factors
