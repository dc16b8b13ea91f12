"""Joules between two times, read off the mains meter.

A reading's power is the mean since the reading before, so energies are exact at readings and linear
between them.
"""

from __future__ import annotations

import numpy as np

from ir_description.robot import DcLink
from ir_msgs_py.arrays import FloatArray
from ir_recorder.read.recording import PowerSeries


class Meter:
    """Cumulative energies over the readings; times [s] outside of them count as the nearest
    reading.
    """

    def __init__(self, power: PowerSeries) -> None:
        self.time = power.time
        self.power = power.power
        self._volts = power.bus_voltage
        step = np.diff(power.time, prepend=power.time[:1])
        self._energy = power.energy - power.energy[:1]
        self._joints = np.cumsum(np.nan_to_num(power.joint_power) * step[:, None], axis=0)
        self._base = np.cumsum(np.nan_to_num(power.base_power) * step)
        self._rectifier = np.cumsum(np.nan_to_num(power.rectifier_loss) * step)
        self._dissipated = np.cumsum(np.nan_to_num(power.burnt_power) * step)

    def energy(self, start: float, end: float) -> float:
        """J at the mains."""
        return self._between(self._energy, start, end)

    def straddling(self, start: float, end: float) -> float:
        """J by which `energy` may be wrong, as the readings at both ends lie partly outside.

        A reading doesn't say when its energy was drawn: of a step shorter than one, nothing is
        known.
        """
        after = np.searchsorted(self.time, [start, end], "left").clip(0, len(self.time) - 1)
        before = (np.searchsorted(self.time, [start, end], "right") - 1).clip(0)
        least = max(float(self._energy[before[1]] - self._energy[after[0]]), 0.0)
        most = float(self._energy[after[1]] - self._energy[before[0]])
        read = self.energy(start, end)
        return max(most - read, read - least)

    def base(self, start: float, end: float) -> float:
        """J of controller, drives and tool."""
        return self._between(self._base, start, end)

    def dissipated(self, start: float, end: float) -> float:
        """J dissipated in the brake resistor."""
        return self._between(self._dissipated, start, end)

    def rectifier(self, start: float, end: float) -> float:
        """J lost in the rectifier."""
        return self._between(self._rectifier, start, end)

    def joints(self, start: float, end: float) -> FloatArray:
        """J per joint (n,) at the DC bus, signed."""
        return np.array([self._between(column, start, end) for column in self._joints.T])

    def peak(self, start: float, end: float) -> float:
        """Largest W of a reading in the interval; NaN where there is none."""
        inside = (self.time > start) & (self.time <= end + 1e-6)
        return float(self.power[inside].max()) if inside.any() else float("nan")

    def stored(self, time: float, link: DcLink) -> float:
        """J in the capacitors of the DC link at a time, by the bus voltage; NaN where it wasn't
        recorded.
        """
        volts = float(np.interp(time, self.time, self._volts))
        return (
            max(0.5 * link.capacitance * (volts**2 - link.voltage**2), 0.0)
            if volts > 0.0
            else float("nan")
        )

    def _between(self, cumulative: FloatArray, start: float, end: float) -> float:
        ends: FloatArray = np.interp([start, end], self.time, cumulative)
        return float(ends[1] - ends[0])
