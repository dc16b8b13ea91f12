"""Joules of a cycle as those of a shift and a year, and as money and CO2, bounds included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ir_msgs_py.before_after import BeforeAfter, Side
from ir_recorder.report.costs import Costs


@dataclass(frozen=True)
class Amount:
    """A value with the ends of its 90 % interval."""

    value: float
    low: float
    high: float

    def of(self, unit: Callable[[float], float]) -> Amount:
        """The same in another unit."""
        return Amount(unit(self.value), unit(self.low), unit(self.high))

    def times(self, count: float) -> Amount:
        """So many of it."""
        return self.of(lambda value: value * count)


@dataclass(frozen=True)
class Year:
    """A program in production: its cycles, the energy [J] of a shift and of a year, and what it
    saves a year [J]. fit_a_shift: cycles that it can make; fewer where it takes longer than those
    that are counted.
    """

    cycles_a_shift: float
    cycles_a_year: float
    fit_a_shift: float
    shift: Amount
    energy: Amount
    saved: Amount


def year_of(found: BeforeAfter, side: Side, costs: Costs) -> Year:
    """A side in production: as many cycles as today's program makes, or as the line asks for."""
    asked = side.cycle_time if side.cycle_time > 0.0 and side is not found.today else 0.0
    seconds = asked or found.today.report.duration
    shift = costs.cycles_per_shift(seconds)
    year = costs.cycles_per_year(seconds)
    report = side.report
    saving = side.saving
    cycle = Amount(report.energy, report.energy_low, report.energy_high)
    saved = Amount(saving.saved, saving.saved_low, saving.saved_high)
    fit = costs.cycles_per_shift(max(report.duration, 1e-9))
    return Year(shift, year, fit, cycle.times(shift), cycle.times(year), saved.times(year))
