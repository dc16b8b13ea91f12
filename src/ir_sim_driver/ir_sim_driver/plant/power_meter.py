"""Mains meter: base load by mode, and the energy of the axes through the DC link."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

import numpy as np

from ir_kernels.power import Regeneration
from ir_msgs_py.modes import DRIVES_ON, Mode
from ir_sim_driver.plant.backend import MotorWork
from ir_sim_driver.plant.dc_link import DcCircuit
from ir_sim_driver.plant.drivetrain import DriveLosses
from ir_sim_driver.plant.plant_parameters import Plant, StandingWatts
from ir_values.arrays import FloatArray

# Base load: controller by mode, drives that are switched on, tool.


class BasePower:
    """Base load of a plant with these watts."""

    def __init__(self, watts: StandingWatts) -> None:
        self._figures = watts
        self._controller = dict(watts.controller)
        self._controller[Mode.STAND_ON_MOTORS] += watts.drives
        self.set_load(0.0, 0.0, 0.0)

    def set_load(self, always: float, drive_bus: float, mass: float) -> None:
        """Take a load as declared: its watts always, and more while the drive bus is up, and its
        mass [kg].
        """
        self._mass = mass
        factor = self._figures.tool
        self._tool = dict.fromkeys(self._controller, factor * always)
        for level in DRIVES_ON & self._tool.keys():
            self._tool[level] += factor * drive_bus
        self._watts = {
            level: watts + self._tool[level] for level, watts in self._controller.items()
        }

    def of(self, level: Mode) -> float:
        """Watts in STAND_ON_MOTORS or a rest by the figures of controller, drives and tool, without
        holding torque.
        """
        return self._watts[level]

    def whole(self, level: Mode, q: FloatArray) -> float | None:
        """Watts at the mains of a robot that stands at q (n,), holding torque included, where that
        was measured by posture and load; None: it was not.
        """
        table = self._figures.rest_table
        if table is None or level.name not in table.modes:
            return None
        return table.watts(level.name, q.tolist(), self._mass)

    def tool(self, level: Mode) -> float:
        """Watts of the tool, a part of `of`."""
        return self._tool[level]


# Meter: energy is the integral of the power.
#
# mains = base + supplied + rectifier loss, and supplied = axes + brake resistor + bleed resistors +
# change of the capacitor; what an axis takes is mechanical work, copper, inverter and iron losses.
# All of it is the plant's own.


@dataclass(frozen=True, eq=False)
class MeterReading:
    """Since the meter started, and in the last step.

    time [s], energy [J] at the mains: of base_energy (tool_energy is a part of it), axis_energy
    (n,), burnt_energy, bled_energy (in the bleed resistors), capacitor_energy and rectifier_energy
    (the precharge resistor's is a part of it). axis_energy is made of mechanical_energy,
    copper_energy, inverter_energy and iron_energy, each (n,). base_power, tool_power [W],
    bus_voltage [V], joint_power (n,) [W], joint_torque (n,) [Nm], joint_current (n,) [A rms] of the
    last step.
    """

    time: float
    energy: float
    burnt_energy: float
    bled_energy: float
    base_energy: float
    tool_energy: float
    rectifier_energy: float
    axis_energy: FloatArray
    mechanical_energy: FloatArray
    copper_energy: FloatArray
    inverter_energy: FloatArray
    iron_energy: FloatArray
    capacitor_energy: float
    base_power: float
    tool_power: float
    bus_voltage: float
    joint_power: FloatArray
    joint_torque: FloatArray
    joint_current: FloatArray


class PowerMeter:
    """Counts steps of dt [s] of `plant`."""

    def __init__(self, plant: Plant, dt: float, regeneration: Regeneration = "shared") -> None:
        self._dt = dt
        self._losses = DriveLosses(plant.drives, np.array(plant.robot.gear_ratio))
        self._circuit = DcCircuit(plant.link, dt, regeneration)
        self._loads: list[tuple[int, float, float, bool, bool, bool]] = []  # of as many steps
        self._pending = 0
        self._steps = 0
        self._supplied = 0.0
        self._dissipated = 0.0
        self._bled = 0.0
        self._rectifier = 0.0
        self._base_energy = 0.0
        self._tool_energy = 0.0
        n = len(plant.robot.joint_names)
        self._parts: FloatArray = np.zeros((4, n))  # mechanical, copper, inverter, iron [J]
        self._power = np.zeros(n)
        self._torque = np.zeros(n)
        self._current = np.zeros(n)
        self._last_base = 0.0
        self._last_tool = 0.0

    def add(
        self,
        base_power: float,
        tool_power: float = 0.0,
        powered: bool = True,
        steps: int = 1,
        *,
        whole: bool = False,
        drive_bus: bool = True,
    ) -> None:
        """Count steps with this base load [W], the tool's share of it, and whether motors are
        on; whole: it holds what the axes take at rest, the base load is what remains. drive_bus:
        whether the mains feed the DC link.
        """
        self._loads.append((steps, base_power, tool_power, powered, whole, drive_bus))
        self._pending += steps

    def settle(self, work: MotorWork) -> None:
        """Take what the motors did in the steps that were added since the last call, one row per
        step.
        """
        if not self._pending:
            return
        dt = self._dt
        counts, base, tool, powered, whole, drive_bus = zip(*self._loads, strict=True)
        axes = self._losses.power(work, np.repeat(np.array(powered, dtype=np.float64), counts))
        total = axes.total
        begin = 0
        for on, loads in groupby(zip(drive_bus, counts, strict=True), key=itemgetter(0)):
            steps = sum(count for _, count in loads)
            if on:
                flows = self._circuit.steps(total[begin : begin + steps])
                self._supplied += flows.supplied
                self._dissipated += flows.dissipated
                self._rectifier += flows.rectifier
            else:  # brakes are closed: the axes take nothing
                self._bled += self._circuit.off(steps)
            begin += steps
        self._steps += len(total)
        self._base_energy += dt * float(np.dot(counts, base))
        self._tool_energy += dt * float(np.dot(counts, tool))
        self._parts = self._parts + dt * np.array([part.sum(axis=0) for part in axes[:4]])
        self._power = total[-1]
        self._torque = work.torque[-1]
        self._current = axes.current[-1]
        self._last_base = base[-1]
        if any(whole):
            at_rest = np.repeat(np.array(whole, dtype=np.float64), counts)
            held = at_rest * self._circuit.drawn(total.sum(axis=1))
            self._base_energy -= dt * float(held.sum())
            self._last_base -= float(held[-1])
        self._last_tool = tool[-1]
        self._loads.clear()
        self._pending = 0

    def reading(self) -> MeterReading:
        """What the meter shows."""
        mechanical, copper, inverter, iron = self._parts
        return MeterReading(
            time=self._steps * self._dt,
            energy=self._base_energy + self._supplied + self._rectifier,
            burnt_energy=self._dissipated,
            bled_energy=self._bled,
            base_energy=self._base_energy,
            tool_energy=self._tool_energy,
            rectifier_energy=self._rectifier,
            axis_energy=self._parts.sum(axis=0),
            mechanical_energy=mechanical,
            copper_energy=copper,
            inverter_energy=inverter,
            iron_energy=iron,
            capacitor_energy=self._circuit.stored,
            base_power=self._last_base,
            tool_power=self._last_tool,
            bus_voltage=self._circuit.voltage,
            joint_power=self._power,
            joint_torque=self._torque,
            joint_current=self._current,
        )
