"""Mains meter: base load by mode, and the DC link circuit that feeds the axes."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from ir_kernels.power import Regeneration
from ir_msgs_py.modes import DRIVES_ON, Mode
from ir_sim_driver.plant.backend import MotorWork
from ir_sim_driver.plant.drivetrain import DriveLosses
from ir_sim_driver.plant.plant_parameters import LinkFigures, Plant, StandingWatts
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


# The DC link as a circuit that is stepped: capacitor, rectifier, brake chopper and resistor.
#
# Within a step the drives take constant power, so the capacitor's energy E = C U^2 / 2 is known
# in closed form: it falls straight with the chopper open, and with e^(-2t/RC) with it closed. A
# step goes from event to event: the rectifier begins to conduct where U falls to the mains'
# voltage, the chopper closes at its upper and opens at its lower voltage. Nothing is lost: what
# the mains gave is what the drives, the resistor and the capacitor took.
#
# Where the drive bus is off the mains are cut from the link, and bleed resistors empty the
# capacitor, U falling with e^(-t/T). When it is on again a constant current charges the capacitor
# to the mains' voltage; what the mains give beyond the capacitor's energy is lost in the precharge
# resistor: of all charge q U_mains, half of it where the capacitor was empty.

_EVENTS = 1000  # in one step: far more than any chopper switches
PRECHARGE = 0.5
"""s in which an empty capacitor is charged: an estimate, which only the peak depends on."""


class Flows(NamedTuple):
    """Energies [J] of a step: through the rectifier into the link (negative: fed back), into the
    brake resistor, and lost in the rectifier and the precharge resistor, which the mains give on
    top.
    """

    supplied: float
    dissipated: float
    rectifier: float


class DcCircuit:
    """Steps of dt [s]; stored [J]: in the capacitor, above what the mains charge it to; negative
    after the drive bus was off, until it is charged again.
    """

    def __init__(
        self, figures: LinkFigures, dt: float, regeneration: Regeneration = "shared"
    ) -> None:
        self._figures = figures
        self._dt = dt
        self._regeneration = regeneration
        half = 0.5 * figures.capacitance
        self._rest = half * figures.mains**2
        self._on = half * (figures.chopper_on**2 - figures.mains**2)
        self._off = half * (figures.chopper_off**2 - figures.mains**2)
        self._tau = 0.5 * figures.resistor * figures.capacitance
        self._closed = False
        self.stored = 0.0

    @property
    def voltage(self) -> float:
        """U [V] of the capacitor."""
        return math.sqrt(2.0 * max(self._rest + self.stored, 0.0) / self._figures.capacitance)

    def off(self, steps: int) -> float:
        """Let steps pass with the drive bus off; the energy [J] that the bleed resistors take."""
        exponent = -2.0 * self._figures.discharge_rate * steps * self._dt
        lost = (self._rest + self.stored) * -math.expm1(exponent)
        self.stored -= lost
        self._closed = False
        return lost

    def step(self, powers: Sequence[float]) -> Flows:
        """Let the axes take constant powers [W] for dt."""
        if self.stored < 0.0:
            return self._charging(sum(powers))
        if self._regeneration == "none":  # every axis has a resistor of its own, nothing is shared
            braked = sum(-p for p in powers if p < 0.0) * self._dt
            supplied = self._ideal(sum(powers) * self._dt + braked)[0]
            return Flows(supplied, braked, self._loss(supplied))
        power = sum(powers)
        if power >= 0.0 and self.stored == 0.0:  # what happens most of the time
            supplied = power * self._dt
            return Flows(supplied, 0.0, self._loss(supplied))
        supplied, dissipated = self._events(power)
        return Flows(supplied, dissipated, self._loss(supplied))

    def steps(self, powers: FloatArray) -> Flows:
        """Let the axes take powers (K, n) [W] for a step each: the sums of the flows of `step`.

        While the capacitor is empty and the axes take power, as nearly always, steps are summed at
        once.
        """
        total = powers.sum(axis=1)
        flows = [0.0, 0.0, 0.0]
        k = 0
        shared = self._regeneration == "shared"
        braking = [*np.flatnonzero(total < 0.0).tolist(), len(total)] if shared else []
        while k < len(total):
            if shared and self.stored == 0.0 and not self._closed:
                first = braking[bisect_left(braking, k)]
                taken = total[k:first]
                amount = float(taken.sum())
                flows[0] += amount * self._dt
                flows[2] += self._losses(amount, float(taken @ taken))
                if first == len(total):
                    break
                k = first
            for j, flow in enumerate(self.step(powers[k].tolist())):
                flows[j] += flow
            k += 1
        return Flows(*flows)

    def drawn(self, powers: FloatArray) -> FloatArray:
        """Watts (K,) that the mains give for axes that take `powers` (K,) [W] in all, with an empty
        capacitor.
        """
        f = self._figures
        taken = np.maximum(powers, 0.0)
        lost = f.rectifier_drop * taken + f.rectifier_resistance / f.mains * taken * taken
        drawn: FloatArray = taken + lost / f.mains
        return drawn

    def _charging(self, power: float) -> Flows:
        """A step while the capacitor is charged to the mains' voltage; the axes are fed beside it,
        and what they give goes into it.
        """
        f = self._figures
        given = max(-power, 0.0) * self._dt
        volts = self.voltage
        after = min(volts + f.mains * self._dt / PRECHARGE, f.mains)
        gained = -self.stored
        if after < f.mains:
            gained = 0.5 * f.capacitance * (after - volts) * (after + volts)
        lost = f.capacitance * (after - volts) * f.mains - gained
        self.stored = 0.0 if after >= f.mains else self.stored + gained
        self.stored += given
        supplied = max(power, 0.0) * self._dt + gained
        return Flows(supplied, 0.0, self._loss(supplied + lost) + lost)

    def _events(self, power: float) -> tuple[float, float]:
        """Energies supplied and dissipated in a step of this power."""
        if self._regeneration == "fed_back" or (self._on == self._off and not self._closed):
            supplied, over = self._ideal(power * self._dt)
            return (supplied - over, 0.0) if self._regeneration == "fed_back" else (supplied, over)
        supplied = 0.0
        dissipated = 0.0
        left = self._dt
        for _ in range(_EVENTS):
            if left <= 0.0:
                break
            used, given, lost = (
                self._braking(power, left) if self._closed else self._free(power, left)
            )
            left = left - used
            supplied = supplied + given
            dissipated = dissipated + lost
        return supplied, dissipated

    def _ideal(self, demand: float) -> tuple[float, float]:
        """Energy from the mains, and over what the capacitor takes, where the chopper has no
        hysteresis.
        """
        stored = self.stored - demand
        self.stored = min(max(stored, 0.0), self._on)
        return max(-stored, 0.0), max(stored - self._on, 0.0)

    def _free(self, power: float, left: float) -> tuple[float, float, float]:
        """Until something switches, with the chopper open: time used, supplied, dissipated."""
        if power > 0.0:
            lasts = self.stored / power
            if lasts <= left:  # the rectifier conducts for the rest of the step
                self.stored = 0.0
                return left, power * (left - lasts), 0.0
        elif power < 0.0:
            room = self._on - self.stored
            if room <= -power * left:
                self.stored = self._on
                self._closed = True
                return room / -power, 0.0, 0.0
        self.stored -= power * left
        return left, 0.0, 0.0

    def _braking(self, power: float, left: float) -> tuple[float, float, float]:
        """Until something switches, with the chopper closed."""
        energy = self._rest + self.stored
        target = self._rest + self._off
        settled = -power * self._tau  # where resistor and drives are in balance
        used = left
        if settled < target:
            used = min(left, self._tau * math.log((energy - settled) / (target - settled)))
        after = settled + (energy - settled) * math.exp(-used / self._tau)
        if used < left:
            after = target
            self._closed = False
        dissipated = energy - after - power * used
        self.stored = after - self._rest
        return used, 0.0, dissipated

    def _loss(self, supplied: float) -> float:
        """Energy lost in the rectifier for what it gives in a step."""
        if supplied <= 0.0:
            return 0.0
        power = supplied / self._dt
        return self._losses(power, power * power)

    def _losses(self, power: float, square: float) -> float:
        """Energy lost in the rectifier in steps whose powers [W] and squares of powers have these
        sums.
        """
        f = self._figures
        return (
            self._dt
            / f.mains
            * (f.rectifier_drop * power + f.rectifier_resistance / f.mains * square)
        )


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
    copper_energy, inverter_energy and iron_energy, each (n,). base_power,
    tool_power [W], bus_voltage [V], joint_power (n,) [W], joint_torque (n,) [Nm], joint_current
    (n,) [A rms] of the last step.
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
