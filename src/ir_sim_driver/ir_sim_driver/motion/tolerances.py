"""Tolerances of a goal as arrays, and the sentence for the joint that broke one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.motion.goal import JointTolerance


@dataclass(frozen=True, eq=False)
class Tolerances:
    """Largest errors (n,) of position [rad] and speed [rad/s]; infinite where unbounded."""

    position: FloatArray
    velocity: FloatArray
    has_velocity: bool

    @classmethod
    def of(
        cls, joint_names: Sequence[str], given: Sequence[JointTolerance], default: float
    ) -> Tolerances:
        """Arrays in the robot's joint order; 0 means the default [rad] (speed: unbounded), -1
        unbounded.
        """
        position = np.full(len(joint_names), default)
        velocity = np.full(len(joint_names), np.inf)
        for tolerance in given:
            j = joint_names.index(tolerance.name)
            if tolerance.position != 0.0:
                position[j] = tolerance.position if tolerance.position > 0.0 else np.inf
            if tolerance.velocity > 0.0:
                velocity[j] = tolerance.velocity
        return cls(position, velocity, bool(np.isfinite(velocity).any()))

    def broken_position(self, joint_names: Sequence[str], error: FloatArray) -> str:
        """Sentence about the worst position error (n,) [rad]; "" when all are within."""
        return _worst(joint_names, error, self.position, "position", "rad")

    def broken_velocity(self, joint_names: Sequence[str], error: FloatArray) -> str:
        """Sentence about the worst speed error (n,) [rad/s]; "" when all are within."""
        return (
            _worst(joint_names, error, self.velocity, "velocity", "rad/s")
            if self.has_velocity
            else ""
        )


def _worst(names: Sequence[str], error: FloatArray, bound: FloatArray, what: str, unit: str) -> str:
    size = np.abs(error)
    if (size <= bound).all():
        return ""
    j = int((size - bound).argmax())
    return (
        f"{names[j]} {what} error is {error[j]:+.6f} {unit}: the tolerance is {bound[j]:g} {unit}"
    )
