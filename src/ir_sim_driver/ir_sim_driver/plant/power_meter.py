"""The mains meter: base load by mode, axes through the common DC bus, energy that is the integral of the
power.

P = P_controller(mode) + P_tool(mode) + P_drives + max(0, bus); axis power at the bus is torque times speed
plus the copper loss (design of the drives: ir_kernels.power).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ir_description import PowerData, RobotModel
from ir_kernels.power import DcBusParameters, Regeneration, dc_bus
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.modes import Mode
from ir_sim_driver.plant.backend import Work


class BasePower:
    """Watts of controller, drives and tool in a mode; `data` is ir_description's PowerData."""

    def __init__(self, data: PowerData) -> None:
        self._controller: dict[Mode, float] = {Mode[mode.name]: mode.controller_watts for mode in data.modes}
        self._drives = float(data.drives_and_brake_release)
        self.set_tool(0.0, 0.0)

    def set_tool(self, always: float, drive_bus: float) -> None:
        """Take the tool's watts: always, and more while the drive bus is up."""
        self._watts = {level: watts + always for level, watts in self._controller.items()}
        for level in (Mode.STAND_ON_MOTORS, Mode.STAND_ON_BRAKES):
            self._watts[level] += drive_bus
        self._watts[Mode.STAND_ON_MOTORS] += self._drives

    def of(self, level: Mode) -> float:
        """Watts in STAND_ON_MOTORS or a rest, without holding torque."""
        return self._watts[level]


@dataclass(frozen=True, eq=False)
class MeterReading:
    """Since the meter started, and in the last steps.

    time [s], energy [J] at the mains, burnt_energy [J], axis_energy (n,) [J] at the DC bus, base_energy [J];
    base_power [W], bus_voltage [V], joint_power (n,) [W] and joint_torque (n,) [Nm] of the last step.
    """

    time: float
    energy: float
    burnt_energy: float
    base_energy: float
    axis_energy: FloatArray
    capacitor_energy: float
    base_power: float
    bus_voltage: float
    joint_power: FloatArray
    joint_torque: FloatArray


class PowerMeter:
    """Counts steps of dt [s] for `robot`; `data` is PowerData."""

    def __init__(
        self, robot: RobotModel, data: PowerData, dt: float, regeneration: Regeneration = "shared"
    ) -> None:
        self._dt = dt
        self._copper: FloatArray = np.array(robot.copper_loss) / np.array(robot.gear_ratio) ** 2
        self._bus = DcBusParameters(data.dc_link_capacity_energy, regeneration)
        self._voltage, self._capacitance = data.dc_link.voltage, data.dc_link.capacitance
        n = len(robot.joint_names)
        self._base: list[float] = []
        self._steps = 0
        self._stored = 0.0
        self._energy = self._dissipated = self._base_energy = 0.0
        self._axes: FloatArray = np.zeros(n)
        self._power: FloatArray = np.zeros(n)
        self._torque: FloatArray = np.zeros(n)
        self._last_base = 0.0

    def add(self, base_power: float) -> None:
        """Count one step with this base load [W]."""
        self._base.append(base_power)

    def pending(self) -> int:
        """Steps that are counted but not yet settled."""
        return len(self._base)

    def settle(self, work: Work) -> None:
        """Take what the motors did in the steps that were added since the last call, one row per step."""
        if not self._base:
            return
        base = np.array(self._base)
        self._base.clear()
        axes = work.torque * work.speed + self._copper * work.torque**2
        bus = dc_bus(axes, self._dt, self._bus, self._stored)
        self._stored = float(bus.stored[-1])
        self._steps += len(base)
        self._energy += self._dt * float((base + bus.mains).sum())
        self._dissipated += self._dt * float(bus.dissipated.sum())
        self._base_energy += self._dt * float(base.sum())
        self._axes = self._axes + self._dt * axes.sum(axis=0)
        self._power, self._torque, self._last_base = axes[-1], work.torque[-1], float(base[-1])

    def reading(self) -> MeterReading:
        """What the meter shows."""
        return MeterReading(
            self._steps * self._dt,
            self._energy,
            self._dissipated,
            self._base_energy,
            self._axes,
            self._stored,
            self._last_base,
            math.sqrt(self._voltage**2 + 2.0 * self._stored / self._capacitance),
            self._power,
            self._torque,
        )
