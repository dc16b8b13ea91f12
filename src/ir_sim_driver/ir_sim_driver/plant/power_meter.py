"""The mains meter: base load by mode, axes through the DC link, energy that is the integral of the
power.

mains = base + supplied + rectifier loss, and supplied = axes + brake resistor + change of the
capacitor; what an axis takes is mechanical work, copper, inverter and iron losses. All of it is the
plant's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ir_kernels.power import Regeneration
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.plant.backend import Work
from ir_sim_driver.plant.dc_circuit import DcCircuit
from ir_sim_driver.plant.drive_losses import DriveLosses
from ir_sim_driver.plant.plant_parameters import Plant


@dataclass(frozen=True, eq=False)
class MeterReading:
    """Since the meter started, and in the last step.

    time [s], energy [J] at the mains: of base_energy (tool_energy is a part of it), axis_energy
    (n,), burnt_energy, capacitor_energy and rectifier_energy. axis_energy is made of
    mechanical_energy, copper_energy, inverter_energy and iron_energy, each (n,). base_power,
    tool_power [W], bus_voltage [V], joint_power (n,) [W], joint_torque (n,) [Nm], joint_current
    (n,) [A rms] of the last step.
    """

    time: float
    energy: float
    burnt_energy: float
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
        self._loads: list[tuple[int, float, float, bool]] = []  # steps that have the same
        self._pending = 0
        self._steps = 0
        self._supplied = self._dissipated = self._rectifier = self._base_energy = (
            self._tool_energy
        ) = 0.0
        n = len(plant.robot.joint_names)
        self._parts: FloatArray = np.zeros((4, n))  # mechanical, copper, inverter, iron [J]
        self._power = self._torque = self._current = np.zeros(n)
        self._last_base = self._last_tool = 0.0

    def add(
        self, base_power: float, tool_power: float = 0.0, powered: bool = True, steps: int = 1
    ) -> None:
        """Count steps with this base load [W], the tool's share of it, and whether motors are
        on.
        """
        self._loads.append((steps, base_power, tool_power, powered))
        self._pending += steps

    def settle(self, work: Work) -> None:
        """Take what the motors did in the steps that were added since the last call, one row per
        step.
        """
        if not self._pending:
            return
        dt = self._dt
        counts, base, tool, powered = zip(*self._loads, strict=True)
        axes = self._losses.power(work, np.repeat(np.array(powered, dtype=np.float64), counts))
        total = axes.total
        flows = self._circuit.steps(total)
        self._supplied += flows.supplied
        self._dissipated += flows.dissipated
        self._rectifier += flows.rectifier
        self._steps += len(total)
        self._base_energy += dt * float(np.dot(counts, base))
        self._tool_energy += dt * float(np.dot(counts, tool))
        self._parts = self._parts + dt * np.array([part.sum(axis=0) for part in axes[:4]])
        self._power = total[-1]
        self._torque = work.torque[-1]
        self._current = axes.current[-1]
        self._last_base = base[-1]
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
