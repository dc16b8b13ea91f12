"""What a cycle costs and what its plan saves: joules, money and CO2 per part, per shift and per
year.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ir_msgs_py.savings import Saving
from ir_recorder.analysis import Analysis
from ir_recorder.report.costs import NAMES, SETTINGS, Costs
from ir_recorder.report.planned import planned_share
from ir_recorder.report.tables import table
from ir_recorder.report.words import DASH, joules, kilowatt_hours, number, seconds, text


@dataclass(frozen=True)
class Cycle:
    """Energy [J] and time [s] of the cycle that the costs are of; name: which cycle that is."""

    name: str
    energy: float
    seconds: float


def cycle_of(analysis: Analysis) -> Cycle | None:
    """The cycle as it is in production: with full pauses where the run's are shortened; of a plan
    that was not driven the planned one; None without either.
    """
    program = analysis.program
    savings = analysis.savings
    planned = planned_share(analysis.recording.planned)
    if program is None and planned is not None:
        return Cycle("planned program, predicted", planned.energy, planned.seconds)
    if program is None and savings is not None and savings.total.seconds > 0.0:
        name = "planned in the common program's time, predicted"
        return Cycle(name, savings.total.planned, savings.total.seconds)
    if program is None or not math.isfinite(program.whole.energy) or program.whole.seconds <= 0.0:
        return None
    full = program.unshortened
    if full is not None and math.isfinite(full.energy):
        return Cycle(
            "cycle with full pauses, computed from this run and the data", full.energy, full.seconds
        )
    name = "this run" if full is None else "this run, its pauses shortened"
    return Cycle(name, program.whole.energy, program.whole.seconds)


def costs_section(analysis: Analysis, costs: Costs) -> str:
    """Section of the page; "" where no program was executed or its energy is unknown."""
    cycle = cycle_of(analysis)
    if cycle is None:
        return ""
    shift = costs.cycles_per_shift(cycle.seconds)
    year = costs.cycles_per_year(cycle.seconds)
    counts = (1.0 / costs.parts_per_cycle, shift, year)
    rows = [_row(cycle.name, cycle.energy, cycle.seconds, counts, costs)]
    rows += _saved(analysis, counts, costs)
    heads = ("", ">a cycle", ">a part", ">a shift", ">a year")
    origin = (
        analysis.recording.origin
        if analysis.program is not None
        else "not there: nothing was driven"
    )
    return (
        '<section id="costs"><h2>What a cycle costs</h2>'
        f'<p class="hint">Energy of the run is {text(origin)}; savings are predicted, with their '
        "90 % "
        "interval, at the same number of cycles.</p>"
        f"{table(heads, rows, 'What a cycle costs')}{_assumptions(costs, counts)}</section>"
    )


def _row(
    name: str, energy: float, length: float, counts: tuple[float, ...], costs: Costs
) -> tuple[str, ...]:
    cycle = f"<b>{joules(energy)}</b><small>{seconds(length)}</small>"
    return (text(name), cycle, *(_priced(energy * count, costs) for count in counts))


def _priced(energy: float, costs: Costs) -> str:
    return (
        f"<b>{text(money(costs.money(energy), costs.currency))}</b><small>{kilowatt_hours(energy)}</small><small>{number(costs.co2(energy), 'kg')} "  # noqa: E501
        "CO2</small>"
    )


def money(value: float, currency: str) -> str:
    """An amount with its currency; small ones with four significant digits."""
    if not math.isfinite(value):
        return DASH
    shown = (
        f"{value:,.0f}"
        if abs(value) >= 100.0
        else f"{value:.2f}"
        if abs(value) >= 1.0
        else f"{value:.4f}"
    )
    return f"{shown.replace(',', ' ')} {currency}"


def _saved(analysis: Analysis, counts: tuple[float, ...], costs: Costs) -> list[tuple[str, ...]]:
    savings = analysis.savings
    if savings is None:
        return []
    program = analysis.program
    cut = (
        " (pauses as shortened)" if program is not None and program.unshortened is not None else ""
    )
    parts = [("saved by its movements", savings.movements, "")]
    if savings.pauses.seconds > 0.0:
        parts += [
            ("saved in its pauses", savings.pauses, cut),
            ("saved together", savings.total, cut),
        ]
    return [_saving(f"{name}{note}", saving, counts, costs) for name, saving, note in parts]


def _saving(name: str, saving: Saving, counts: tuple[float, ...], costs: Costs) -> tuple[str, ...]:
    cells = [f"<b>{joules(saving.saved)}</b>{_joule_range(saving)}"]
    for count in counts:
        low, high = (costs.money(end * count) for end in (saving.saved_low, saving.saved_high))
        amount = text(money(costs.money(saving.saved * count), costs.currency))
        between = (
            f"<small>{text(money(low, ''))}to {text(money(high, ''))}</small>" if high > low else ""
        )
        cells.append(f"<b>{amount}</b>{between}")
    return (text(name), *cells)


def _joule_range(saving: Saving) -> str:
    if saving.saved_high <= saving.saved_low:
        return ""
    return f"<small>{joules(saving.saved_low)} to {joules(saving.saved_high)}</small>"


def _assumptions(costs: Costs, counts: tuple[float, ...]) -> str:
    """What the amounts rest on; what no file gave is named an assumption."""
    items = []
    for each in SETTINGS:
        value = getattr(costs, each.name)
        shown = value if isinstance(value, str) else f"{value:g} {each.unit}".strip()
        mark = "" if each.name in costs.given else " (assumed)"
        items.append(f"{each.name.replace('_', ' ')} {shown}{mark}")
    a_shift, a_year = (f"{count:,.0f}".replace(",", " ") for count in counts[1:3])
    made = f"{a_shift} cycles a shift, {a_year} a year"
    assumed = "" if set(NAMES) <= set(costs.given) else " Give your own with --costs costs.yaml."
    return f'<p class="hint">{text(made)}; {text(", ".join(items))}.{assumed}</p>'
