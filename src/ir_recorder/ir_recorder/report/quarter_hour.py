"""The largest quarter of an hour of a year, and what it costs: of cycles one after the other, and
of rest outside of the shifts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ir_recorder.analysis import Analysis
from ir_recorder.analysis.production import (
    HIBERNATION,
    LEFT_ALONE,
    Production,
    demand_watts,
    idle_watts,
)
from ir_recorder.report.money_text import (
    money,
)
from ir_recorder.report.number_text import (
    text,
    watts,
)
from ir_recorder.report.prices import Costs
from ir_recorder.report.program_names import ON_BRAKES

DEMAND_LEAVES_OUT = "Waking up, and standing still within the shifts, are not in it."
"""What no largest quarter of an hour counts."""


@dataclass(frozen=True)
class Demand:
    """The largest quarter of an hour of a year: shifts [W], of cycles one after the other; rest
    [W], outside of the shifts in a mode, NaN where it isn't known or there is no such time; how:
    the mode in words.
    """

    shifts: float
    rest: float = math.nan
    how: str = ""

    @property
    def watts(self) -> float:
        """Of all hours."""
        return self.rest if self.rest > self.shifts else self.shifts

    @property
    def words(self) -> str:
        """Where it lies, and what the other hours take at most."""
        if not math.isfinite(self.rest):
            return "in shifts alone"
        nights = "at night and at weekends"
        if self.rest > self.shifts:
            return f"{nights}, {self.how}; in shifts {watts(self.shifts)}"
        return f"in shifts; {nights} {watts(self.rest)}, {self.how}"

    def plus(self, other: Demand) -> Demand:
        """Of two robots, as if their largest quarters came at once."""
        how = self.how if self.how == other.how else "each as its year is counted"
        return Demand(self.shifts + other.shifts, self.rest + other.rest, how)


def demand_of(shifts: float, rests: Mapping[str, float], costs: Costs, *, planned: bool) -> Demand:
    """That of a robot with so many W in shifts, and at rest by power mode: planned ones rest in
    their deepest mode, all others on closed brakes, as their year is counted.
    """
    mode, how = (HIBERNATION, "in hibernation") if planned else (LEFT_ALONE, ON_BRAKES)
    if mode not in rests or costs.idle_hours <= 0.0:
        return Demand(shifts)
    return Demand(shifts, rests[mode], how)


def recorded_demand(analysis: Analysis, cycle: Production, costs: Costs) -> Demand:
    """The same of the robot of a recording; of a plan that was not driven, as planned."""
    planned = analysis.program is None
    shifts = demand_watts(analysis, cycle)
    return demand_of(shifts, idle_watts(analysis), costs, planned=planned)


def quarter_sentence(analysis: Analysis, cycle: Production, costs: Costs) -> str:
    """The largest quarter of an hour, and its price where one is given."""
    found = recorded_demand(analysis, cycle, costs)
    price = demand_note(found.watts, costs)
    words = f", {price}" if price else "; demand_price gives it a price"
    limit = f" ({cycle.supply})" if cycle.supply else ""
    return (
        f"The largest quarter of an hour takes {watts(found.watts)} on average{limit}{text(words)}:"
        f" {text(found.words)}. {DEMAND_LEAVES_OUT}"
    )


def demand_note(peak: float, costs: Costs) -> str:
    """What the largest quarter of an hour [W] costs a year; "" where its price isn't given."""
    if costs.demand_price <= 0.0:
        return ""
    return f"{money(peak / 1000.0 * costs.demand_price, str(costs.currency))} a year"
