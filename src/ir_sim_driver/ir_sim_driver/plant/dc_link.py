"""DC link as a circuit that is stepped: capacitor, rectifier, brake chopper and resistor.

Within a step the drives take constant power, so the capacitor's energy E = C U^2 / 2 is known
in closed form: it falls straight with the chopper open, and with e^(-2t/RC) with it closed. A
step goes from event to event: the rectifier begins to conduct where U falls to the mains'
voltage, the chopper closes at its upper and opens at its lower voltage. Nothing is lost: what
the mains gave is what the drives, the resistor and the capacitor took.

Where the drive bus is off the mains are cut from the link, and bleed resistors empty the
capacitor, U falling with e^(-t/T). When it is on again a constant current charges the capacitor
to the mains' voltage; what the mains give beyond the capacitor's energy is lost in the precharge
resistor: of all charge q U_mains, half of it where the capacitor was empty.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ir_kernels.power import Regeneration
from ir_sim_driver.plant.plant_parameters import LinkFigures
from ir_values.arrays import FloatArray

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
