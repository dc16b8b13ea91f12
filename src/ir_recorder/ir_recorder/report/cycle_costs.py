"""What a cycle costs and what its plan saves: joules, money and CO2 of a part, a shift and a year;
and what to change first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ir_msgs_py.savings import Saving
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.predicted_power import MOTORS
from ir_recorder.analysis.production import (
    Amount,
    Production,
    idle_watts,
    levers,
    production_of,
    saved_amount,
)
from ir_recorder.report.money_text import (
    NEXT_TO_NOTHING,
    NOTHING,
    UNSEEN,
    hours_of,
    money,
    months_of,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.nights import recorded_idle_saving
from ir_recorder.report.number_text import (
    DASH,
    kilograms,
    kilowatt_hours,
    seconds,
    share,
    span_of,
    text,
    watt_hours,
    whole,
)
from ir_recorder.report.prices import Costs, counted_with
from ir_recorder.report.program_names import COMMON, PLANNED, own_pace
from ir_recorder.report.tables import bar, table


def costs_section(analysis: Analysis, costs: Costs) -> str:
    """Section of the page; "" where no whole cycle is known."""
    cycle = production_of(analysis)
    if cycle is None:
        return ""
    driven = analysis.program is not None
    rows = [*_before(cycle, costs, driven), _row(cycle, costs), *_saved(cycle, costs)]
    heads = ("", ">a cycle", ">1 000 parts", ">a shift", ">a year")
    origin = (
        f"Energy of the run is {analysis.recording.origin}"
        if driven
        else "Nothing was driven: energy is that of the plan, predicted"
    )
    notes = "".join(f" {note[0].upper()}{note[1:]}." for note in cycle.notes)
    pace = own_pace(cycle)
    waits = _waits(cycle, costs, idle_watts(analysis))
    return (
        '<section id="costs"><h2>What a cycle costs</h2>'
        f"{table(heads, rows, 'What a cycle costs')}"
        f'<p class="hint">{text(origin)}{_saving_is(cycle)}. A year has '
        f"{cycles_of_year(cycle.pace, costs)}{waits}.{text(notes)}"
        f"{_bridge(analysis, cycle)}{text(f' {pace}' if pace else '')} {counted_with(costs)}</p>"
        "</section>"
    )


def _saving_is(cycle: Production) -> str:
    if cycle.savings is None:
        return ""
    return "; programs and savings are predicted. Small: 90 % intervals, whose ends add up"


def _waits(cycle: Production, costs: Costs, rests: Mapping[str, float]) -> str:
    """Why the cycles of a year are longer than the cycle, where that shows, and what the common
    program needs for them where it is slower; "" elsewhere. rests: W at rest by power mode.
    """
    if cycle.savings is None:
        return ""
    if cycle.savings.common_seconds > cycle.pace:
        more = costs.cycles_per_year(cycle.pace) * (cycle.savings.common_seconds - cycle.pace)
        return f"; the common program would need {more / 3600.0:.0f} h more for them"
    if seconds(cycle.pace) == seconds(cycle.seconds):
        return ""
    sooner = cycle.pace - cycle.seconds
    watts_then = rests.get(MOTORS)
    taken = (
        "" if watts_then is None else f" (at most {kilowatt_hours(sooner * watts_then)} a cycle)"
    )
    return (
        f" as in the common program; this cycle ends {seconds(sooner)} sooner, and what the robot "
        f"takes while it waits for the next is not counted{taken}"
    )


def _bridge(analysis: Analysis, cycle: Production) -> str:
    """From the energy of the recording to that of the cycle, in a sentence; "" where there is no
    cycle with full pauses.
    """
    program = analysis.program
    if program is None or program.unshortened is None:
        return ""
    return text(
        f" The recording took {kilowatt_hours(analysis.energy)}, what was recorded before and "
        f"after included; the program in it {kilowatt_hours(program.whole.energy)}, its pauses "
        f"shortened; a cycle with full pauses {kilowatt_hours(cycle.energy)}."
    )


def _counts(pace: float, costs: Costs) -> tuple[float, float, float]:
    """Cycles of a thousand parts, a shift and a year, with so many seconds [s] from one to the
    next.
    """
    thousand = 1000.0 / costs.parts_per_cycle
    return thousand, costs.cycles_per_shift(pace), costs.cycles_per_year(pace)


def cycles_of_year(pace: float, costs: Costs) -> str:
    """How many cycles a year counts, in words."""
    return f"{whole(costs.cycles_per_year(pace))} cycles, one each {seconds(pace)}"


def _before(cycle: Production, costs: Costs, driven: bool) -> list[tuple[str, ...]]:
    """The common program, where the cycle is held against it, and above a cycle that was driven
    the planned one, which savings belong to.
    """
    if cycle.savings is None:
        return []
    total = cycle.savings.total
    own = total.seconds or cycle.seconds
    alone = cycle.savings.common_seconds or own
    rows = [_cycle_row(f"{COMMON}, predicted", alone, total.common, cycle.pace, costs)]
    if driven:
        row = _cycle_row(f"{PLANNED}, predicted", own, total.planned, cycle.pace, costs)
        rows.append(row)
    return rows


def _row(cycle: Production, costs: Costs) -> tuple[str, ...]:
    return _cycle_row(cycle.name, cycle.pace, cycle.energy, cycle.pace, costs)


def _cycle_row(
    name: str, length: float, energy: float, pace: float, costs: Costs
) -> tuple[str, ...]:
    counts = _counts(pace, costs)
    shown = f"<b>{kilowatt_hours(energy)}</b><small>{seconds(length)}</small>"
    year = energy * counts[-1]
    return (text(name), shown, *(_priced(energy * count, year, costs) for count in counts))


def _priced(energy: float, year: float, costs: Costs) -> str:
    """Energy of a part, a shift or a year, which takes `year` [J] in all."""
    shown = _shown(costs.money(energy), costs.money(year), costs.currency)
    return (
        f"<b>{text(shown)}</b><small>{kilowatt_hours(energy)}</small>"
        f"<small>{kilograms(costs.co2(energy))} CO2</small>"
    )


def _shown(value: float, year: float, currency: str) -> str:
    """An amount of a part, a shift or a year; in words where it, or the whole year, is too little
    to count.
    """
    if 0.0 < abs(value) < UNSEEN or 0.0 < abs(year) < NOTHING:
        return NEXT_TO_NOTHING
    return money(value, currency)


def _saved(cycle: Production, costs: Costs) -> list[tuple[str, ...]]:
    savings = cycle.savings
    if savings is None:
        return []
    parts = [("by its movements", savings.movements)]
    if savings.pauses.seconds > 0.0:
        parts += [("in its pauses", savings.pauses), ("together", savings.total)]
    return [_saving(name, saving, cycle.pace, costs) for name, saving in parts]


def _saving(where: str, saving: Saving, pace: float, costs: Costs) -> tuple[str, ...]:
    word, amount = saved_amount(saving).gain()
    doubt = f"<small>{amount.doubt}</small>" if amount.doubt else ""
    cells = [f"<b>{kilowatt_hours(amount.value)}</b>{small_span(amount, kilowatt_hours)}{doubt}"]
    counts = _counts(pace, costs)
    year = costs.money(amount.value * counts[-1])
    for count in counts:
        price = amount.times(count).of(costs.money)
        shown = _shown(price.value, year, costs.currency)
        between = ""
        if abs(year) >= NOTHING and price.high > price.low:
            between = (
                f"<small>{text(yearly_span(price.low, price.high, costs.currency, UNSEEN))}</small>"
            )
        cells.append(f"<b>{text(shown)}</b>{between}")
    return (f"{word} {where}", *cells)


def small_span(amount: Amount, show: Callable[[float], str]) -> str:
    """The interval of an amount in small letters (HTML), "" where it has none."""
    if amount.high <= amount.low:
        return ""
    return f"<small>{text(span_of(amount.low, amount.high, show))}</small>"


def money_of_thousand(energy: float, costs: Costs) -> str:
    """What a thousand parts of so many joules cost: one costs too little to be read."""
    return f"{money(1000.0 * costs.money(energy), costs.currency)} for 1 000"


def payback(money: Amount, costs: Costs) -> str:
    """How many hours of an engineer a saving of a year pays for, and after how long one is paid;
    "" where it is open whether anything is saved, or next to nothing is.
    """
    if money.doubt or money.value < NOTHING or costs.engineer_hour <= 0.0:
        return ""
    hours = hours_of(money.value, costs.engineer_hour, costs.currency)
    hour = f"{costs.engineer_hour:g} {costs.currency}/h"
    months = months_of(money.value, costs.engineer_hour, costs.currency)
    return f"pays for {hours} h of an engineer a year ({hour}), for one hour in {months} months"


def share_between(amount: Amount, of: float) -> str:
    """The 90 % interval of a share of `of` [J], in percent as the share itself; "" without
    one.
    """
    if of <= 0.0 or amount.high <= amount.low:
        return ""
    low, high = (100.0 * end / of for end in (amount.low, amount.high))
    return f"90 % interval {low:.1f} to {high:.1f} %"


def lever_section(analysis: Analysis, costs: Costs) -> str:
    """Section of the page; "" where no lever is known."""
    found = levers(analysis)
    cycle = production_of(analysis)
    if not found or cycle is None:
        return ""
    yearly = costs.cycles_per_year(cycle.pace)
    rows = [
        (
            costs.money(lever.joules * yearly),
            f"{text(lever.name)}<small>{text(lever.means)}; counted: {text(lever.basis)}</small>",
            f"<b>{watt_hours(lever.joules)}</b><small>{share(lever.joules, cycle.energy)}</small>",
        )
        for lever in found
    ]
    known = cycle.savings is not None
    idle = None if known else recorded_idle_saving(analysis, costs)
    if idle is not None:
        words = f"{idle.mode} instead of brakes that are only closed, {idle.basis}"
        ends = f"{yearly_span(idle.money.low, idle.money.high, costs.currency)} {costs.currency}"
        words += f", 90 % interval {ends}" if idle.money.low < idle.money.high else ""
        name = f"at night and at weekends<small>{text(words)}</small>"
        rows.append((idle.saved, name, DASH))
    rows.sort(key=lambda row: -row[0])
    most = max(rows[0][0], 1e-9)
    cells = [
        (name, joules, text(yearly_money(money, costs.currency)), bar(money, most, "planned"))
        for money, name, joules in rows
    ]
    heads = ("what", ">a cycle, at most", ">a year, at most", "")
    head = "What is still left after this plan" if known else "What to change first"
    plan = "What the plan saves is no longer in them. " if known else ""
    return (
        f'<section id="levers"><h2>{head}</h2><p class="hint">{plan}Upper bounds from '
        "figures of this run, each by itself: together they count some joules twice.</p>"
        f"{table(heads, cells, head)}</section>"
    )
