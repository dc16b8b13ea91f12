"""Motors that turn with other joints than their own, as those of many wrists: the one definition.

Joints turn at qd, motors at w = T qd, each seen at its own joint; T is `turns`. Torques t of the
joints and m of the motors give the same power, m'w = t'qd, so m = T^-T t. Friction, rotor inertia,
losses and torque envelopes belong to the motors.
"""

from __future__ import annotations

import numpy as np

from ir_kernels import portable
from ir_kernels.errors import KernelError
from ir_values.arrays import FloatArray


class Coupling:
    """How the motors of n joints turn with them; turns (n, n): rows are motors, columns joints.

    Arrays (..., n) in and out; without a coupling they come back as they are. Raises KernelError
    where joints do not follow from motors.
    """

    def __init__(self, turns: FloatArray) -> None:
        n = len(turns)
        self.turns = np.array(turns, dtype=np.float64)
        self.coupled = not np.array_equal(self.turns, np.eye(n))
        try:
            self.inverse = portable.inv(self.turns) if self.coupled else np.eye(n)
        except np.linalg.LinAlgError as error:
            raise KernelError(
                "motor_turns is singular: joints do not follow from motors"
            ) from error
        if not np.isfinite(self.inverse).all():
            raise KernelError("motor_turns: joints do not follow from motors")
        for array in (self.turns, self.inverse):
            array.setflags(write=False)

    def motors(self, motion: FloatArray) -> FloatArray:
        """Motion (..., n) of the motors, T motion: angles [rad], speeds or accelerations."""
        return portable.matmul(motion, self.turns.T) if self.coupled else motion

    def joints(self, motion: FloatArray) -> FloatArray:
        """Motion (..., n) of the joints where the motors move so, T^-1 motion."""
        return portable.matmul(motion, self.inverse.T) if self.coupled else motion

    def motor_torque(self, torque: FloatArray) -> FloatArray:
        """Torques (..., n) [Nm] of the motors for these of the joints, T^-T torque."""
        return portable.matmul(torque, self.inverse) if self.coupled else torque

    def joint_torque(self, torque: FloatArray) -> FloatArray:
        """Torques (..., n) [Nm] at the joints of these of the motors, T^T torque."""
        return portable.matmul(torque, self.turns) if self.coupled else torque

    def most(self, speed: FloatArray) -> FloatArray:
        """Bounds (..., n) of the motors' speeds where no joint is faster than this, |T| speed."""
        return portable.matmul(speed, np.abs(self.turns).T) if self.coupled else speed
