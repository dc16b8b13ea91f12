"""Figures of today's program and of the planner's as tables: each energy with its 90 % interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ir_msgs_py.before_after import BeforeAfter, Change, Side
from ir_recorder.report.before_after.amounts import Amount, Year, year_of
from ir_recorder.report.costs import SETTINGS, Costs
from ir_recorder.report.money import money
from ir_recorder.report.tables import table
from ir_recorder.report.words import (
    DASH,
    joules,
    kilowatt_hours,
    millimetres,
    number,
    seconds,
    text,
    watts,
)

WORK = {1: "a power mode", 2: "other times on the same path", 3: "another path"}
Show = Callable[[float], str]
_FIT = 0.999  # of the cycles: fewer are said
OPEN = "zero lies in it: it is open whether anything is saved"


def tiles(found: BeforeAfter, costs: Costs) -> str:
    """The answer in five figures, of the side that the changes lead to."""
    side = found.planned
    report = found.planned.report
    today = found.today.report
    saved = side.saving
    year = year_of(found, side, costs).saved
    sure = "" if saved.certain else OPEN
    between = _between(saved.saved_low, saved.saved_high, joules)
    shown = (
        ("saved a cycle", f"{100.0 * saved.share:.1f} %", between, sure),
        ("saved a year", money(costs.money(year.value), costs.currency), _money(year, costs)),
        (
            "CO2 saved a year",
            number(costs.co2(year.value), "kg"),
            f"{kilowatt_hours(year.value)} less",
        ),
        ("cycle time", seconds(report.duration), f"today {seconds(today.duration)}", side.name),
        (
            "peak power",
            watts(report.peak_power),
            _between(*side.peak, watts),
            f"today {watts(today.peak_power)}",
        ),
    )
    return "".join(
        f'<div class="tile"><span>{text(name)}</span>{_cell(value, *lines)}</div>'
        for name, value, *lines in shown
    )


def figure_table(found: BeforeAfter, costs: Costs) -> str:
    """Every figure, a column for each program."""
    sides = [found.today, *found.sides]
    years = [year_of(found, side, costs) if side.found else None for side in sides]
    rows = [
        ("cycle time", *(_of(side, seconds(side.report.duration)) for side in sides)),
        ("energy a cycle", *(_energy(side, joules) for side in sides)),
        ("the same in kWh", *(_energy(side, kilowatt_hours) for side in sides)),
        ("saved a cycle", *(_saved(side, side is found.today) for side in sides)),
        ("cycles a shift", *(_cycles(year) for year in years)),
        (
            "energy a shift",
            *(_amount(year.shift if year else None, kilowatt_hours) for year in years),
        ),
        (
            "energy a year",
            *(_amount(year.energy if year else None, kilowatt_hours) for year in years),
        ),
        ("costs a year", *(_cost(year.energy if year else None, costs) for year in years)),
        (
            "saved a year",
            *(_cost(year.saved if year and k else None, costs) for k, year in enumerate(years)),
        ),
        ("CO2 a year", *(_co2(year, costs) for year in years)),
        (
            "peak power",
            *(
                _of(side, watts(side.report.peak_power), _between(*side.peak, watts))
                for side in sides
            ),
        ),
        ("least clearance", *(_of(side, millimetres(side.report.min_clearance)) for side in sides)),
        ("clearance and limits", *(_proof(side) for side in sides)),
    ]
    return table(("", *(f">{side.name}" for side in sides)), rows, "Figures")


def change_table(found: BeforeAfter, costs: Costs) -> str:
    """The changes that save most, the least work first."""
    if not found.changes:
        return '<p class="empty">No change saves as much as a joule.</p>'
    cycles = year_of(found, found.planned, costs).cycles_a_year
    rows = [_change(k, change, cycles, costs) for k, change in enumerate(found.changes, start=1)]
    heads = ("#", "where", "work", "what to do", ">saved a cycle", ">saved a year")
    return table(heads, rows, "Changes")


def _change(k: int, change: Change, cycles: float, costs: Costs) -> tuple[str, ...]:
    saving = change.saving
    between = _between(saving.saved_low, saving.saved_high, joules)
    return (
        str(k),
        text(change.name),
        text(WORK[change.work]),
        text(change.words),
        _cell(joules(saving.saved), between, "" if saving.certain else OPEN),
        text(money(costs.money(saving.saved * cycles), costs.currency)),
    )


def hop_table(found: BeforeAfter) -> str:
    """Seconds and joules of every movement and pause, matched by their stops."""
    sides = [side for side in (found.today, *found.sides) if side.found]
    keyed = [dict(_keyed(side)) for side in sides]
    keys = list(dict.fromkeys(key for own in keyed for key in own))
    rows = [(text(key[0]), *(own.get(key, DASH) for own in keyed)) for key in keys]
    return table(("", *(f">{side.name}" for side in sides)), rows, "Movements and pauses")


def _keyed(side: Side) -> Sequence[tuple[tuple[str, int], str]]:
    times: dict[str, int] = {}
    found = []
    for hop in side.hops:
        times[hop.name] = times.get(hop.name, 0) + 1
        mode = hop.power_mode.replace(">", ", ").replace("_", " ").lower()
        between = _between(hop.energy_low, hop.energy_high, joules)
        cell = _cell(
            joules(hop.energy), between, f"{seconds(hop.seconds)}{f', {mode}' if mode else ''}"
        )
        found.append(((hop.name, times[hop.name]), cell))
    return found


def assumptions(found: BeforeAfter, costs: Costs) -> str:
    """What the amounts rest on; what no file gave is named an assumption."""
    items = []
    for each in SETTINGS:
        value = getattr(costs, each.name)
        shown = value if isinstance(value, str) else f"{value:g} {each.unit}".strip()
        mark = "" if each.name in costs.given else " (assumed)"
        items.append(f"{each.name.replace('_', ' ')} {shown}{mark}")
    parameters = found.today.report.power_parameters or "the data sheet"
    said = (
        "All energies are predicted at the mains by the same model, with 90 % intervals from "
        f"the uncertainty of the power parameters ({parameters}). What is saved has an interval "
        "of its own: the same drawn robots drive both programs. Intervals by the data sheet lie "
        "mostly above their values: losses that it puts at zero can only add. A year has as "
        "many cycles for every program as today's can make, in the column for the line as many "
        "as the line asks for, and there today's program waits at its end as well; what is left "
        "of a shift counts nothing."
    )
    return f'<p class="hint">{text(said)}</p><p class="hint">{text(", ".join(items))}.</p>'


def _cell(value: str, *smaller: str) -> str:
    return f"<b>{text(value)}</b>" + "".join(
        f"<small>{text(line)}</small>" for line in smaller if line
    )


def _of(side: Side, shown: str, *smaller: str) -> str:
    return _cell(shown, *smaller) if side.found else DASH


def _energy(side: Side, show: Show) -> str:
    report = side.report
    return _amount(
        Amount(report.energy, report.energy_low, report.energy_high) if side.found else None, show
    )


def _saved(side: Side, own: bool) -> str:
    if own or not side.found:
        return DASH
    saving = side.saving
    between = _between(saving.saved_low, saving.saved_high, joules)
    doubt = "" if saving.certain else OPEN
    return _cell(f"{100.0 * saving.share:.1f} %", joules(saving.saved), between, doubt)


def _cycles(year: Year | None) -> str:
    if year is None:
        return DASH
    few = year.fit_a_shift < _FIT * year.cycles_a_shift
    return _cell(
        _count(year.cycles_a_shift),
        f"only {_count(year.fit_a_shift)} fit: it is slower" if few else "",
    )


def _count(cycles: float) -> str:
    return f"{cycles:,.0f}".replace(",", " ")


def _amount(amount: Amount | None, show: Show) -> str:
    if amount is None:
        return DASH
    return _cell(show(amount.value), _between(amount.low, amount.high, show))


def _cost(energy: Amount | None, costs: Costs) -> str:
    if energy is None:
        return DASH
    return _cell(money(costs.money(energy.value), costs.currency), _money(energy, costs))


def _co2(year: Year | None, costs: Costs) -> str:
    return _amount(year.energy.of(costs.co2) if year else None, lambda value: number(value, "kg"))


def _money(energy: Amount, costs: Costs) -> str:
    amount = energy.of(costs.money)
    return f"{money(amount.low, '').strip()} to {money(amount.high, '').strip()}"


def _proof(side: Side) -> str:
    if not side.found:
        return text(f"none: {side.problem}")
    return '<b class="good">proved</b>' if side.certified else '<b class="bad">not certified</b>'


def _between(low: float, high: float, show: Show) -> str:
    return f"{show(low)} to {show(high)}"
