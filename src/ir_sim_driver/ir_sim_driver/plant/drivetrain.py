"""What stands between motor and link beside friction: rotor inertia, counterbalance, the torque
envelope (eq. 8).

One robot at a time and in plain floats where that is faster: this runs every millisecond.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from operator import gt

import numpy as np

from ir_description import RobotModel
from ir_msgs_py.arrays import FloatArray


class Drivetrain:
    """Drives of the n joints of `robot` (an ir_description RobotModel).

    rotor_inertia (n,) [kg m^2], seen at the joint.
    """

    def __init__(self, robot: RobotModel) -> None:
        self.rotor_inertia: FloatArray = np.array(robot.reflected_inertia)
        c = robot.counterbalance
        self._gas_joint = -1 if c is None else c.joint
        # plain floats: five times faster than numpy's, every millisecond
        self._gas_spring = (
            None
            if c is None
            else tuple(
                float(x)
                for x in (
                    *c.pivot,
                    *c.rod_eye,
                    c.piston_area,
                    c.gas_volume,
                    c.charge_pressure,
                    c.rod_length_at_charge,
                    c.exponent,
                )
            )
        )
        self._speeds: list[list[float]] = np.array(robot.envelope_speed).tolist()
        self._torques: list[list[float]] = np.array(robot.envelope_torque).tolist()
        self._least: list[float] = np.array(robot.envelope_torque)[:, -1].tolist()

    def counterbalance(self, q: Sequence[float]) -> list[float]:
        """What the counterbalance does about the positive axes (n,) [Nm]."""
        torque = [0.0] * len(q)
        if self._gas_spring is not None:
            torque[self._gas_joint] = self.counterbalance_torque(q[self._gas_joint])
        return torque

    def counterbalance_torque(self, angle: float) -> float:
        """Torque [Nm] about the positive axis at the joint angle [rad]; formula of ir_description's
        data.
        """
        if self._gas_spring is None:
            return 0.0
        bx, bz, ex, ez, area, gas_volume, pressure, length_at_charge, exponent = self._gas_spring
        sin = math.sin(angle)
        cos = math.cos(angle)
        px = cos * ex + sin * ez
        pz = cos * ez - sin * ex
        length = math.hypot(px - bx, pz - bz)
        volume = gas_volume - area * (length - length_at_charge)
        force: float = area * pressure * (gas_volume / volume) ** exponent
        return force * (pz * (bx - px) - px * (bz - pz)) / length

    def limited(self, torque: Sequence[float], qd: Sequence[float]) -> tuple[FloatArray, bool]:
        """Torque (n,) within the envelope at the speeds qd, and whether anything was cut off."""
        result = np.array(torque)
        cut = False
        if not any(map(gt, map(abs, torque), self._least)):
            return result, cut
        for j, (t, least) in enumerate(zip(torque, self._least, strict=True)):
            if abs(t) > least:
                limit = self._limit_of(j, abs(qd[j]))
                if abs(t) > limit:
                    result[j] = math.copysign(limit, t)
                    cut = True
        return result, cut

    def limit(self, qd: FloatArray) -> FloatArray:
        """Torque (n,) [Nm] available at the speeds |qd|."""
        return np.array([self._limit_of(j, speed) for j, speed in enumerate(np.abs(qd).tolist())])

    def _limit_of(self, j: int, speed: float) -> float:
        speeds = self._speeds[j]
        torques = self._torques[j]
        k = bisect_right(speeds, speed)
        if k == 0 or k == len(speeds):
            return torques[k]
        share = (speed - speeds[k - 1]) / (speeds[k] - speeds[k - 1])
        return torques[k] + share * (torques[k + 1] - torques[k])
