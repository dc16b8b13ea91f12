"""What an axis takes from the DC link: torque times speed, and the losses of motor and inverter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.plant.backend import Work
from ir_sim_driver.plant.plant_parameters import DriveFigures


class AxisPower(NamedTuple):
    """Each (K, n) [W], one row per step; current [A rms], with the sign of the torque."""

    mechanical: FloatArray
    copper: FloatArray
    inverter: FloatArray
    iron: FloatArray
    current: FloatArray

    @property
    def total(self) -> FloatArray:
        """What the axes take from the DC link (K, n) [W]."""
        total: FloatArray = self.mechanical + self.copper + self.inverter + self.iron
        return total


class DriveLosses:
    """Servo drives with these figures behind gears of `ratio` (n,)."""

    def __init__(self, figures: DriveFigures, ratio: FloatArray) -> None:
        self._figures = figures
        self._ratio = np.array(ratio)

    def power(self, work: Work, powered: FloatArray) -> AxisPower:
        """Power in K steps; powered (K,): 1 in steps with motors on, else 0."""
        f = self._figures
        torque = work.torque / self._ratio
        speed = np.abs(work.speed) * self._ratio
        current = torque / f.torque_constant
        on = powered[:, None]
        return AxisPower(
            work.torque * work.speed,
            f.copper * torque**2,
            f.inverter * np.abs(current) + f.switching * on,
            (f.iron_linear * speed + f.iron_square * speed**2) * on,
            current,
        )
