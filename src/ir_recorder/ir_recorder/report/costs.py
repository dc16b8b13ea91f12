"""Energy, money and CO2 of a cycle: prices, savings, and what to change first."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeGuard

from ir_description import Cell, DescriptionFileError, load_power_data
from ir_description.files import plain_yaml
from ir_msgs_py.savings import Saving
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.predicted_power import MOTORS
from ir_recorder.analysis.production import (
    HIBERNATION,
    Amount,
    Production,
    demand_watts,
    idle_watts,
    levers,
    production_of,
    rest_basis,
    rest_measured,
    rest_saving,
    saved_amount,
)
from ir_recorder.errors import RecorderError
from ir_recorder.report.money_text import (
    NEXT_TO_NOTHING,
    NOTHING,
    UNSEEN,
    Repriced,
    hours_of,
    money,
    months_of,
    price_of,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.number_text import (
    DASH,
    kilograms,
    kilowatt_hours,
    seconds,
    share,
    significant,
    span_of,
    text,
    watt_hours,
    watts,
    whole,
)
from ir_recorder.report.tables import COMPACT, bar, table
from ir_values.errors import InvalidValueError, IrError
from ir_values.files import ANYWHERE, FileRoots
from ir_values.settings import Setting, check_settings, describe, setting

# What joules cost, from a file or as assumed: prices by day and night and of the peak, the calendar
# of shifts, and the grid's CO2.

TODAY = "today's program"
COMMON = "common program"
PLANNED = "planned program"
"""The programs that are compared, on every page by the same name: today's, what stands for it where
nobody gave it, and the planner's.
"""
FORMAT = "ir_costs/1"
_CURRENCY_MAX = 12  # characters
J_PER_KWH = 3.6e6
_DAY = 24.0  # h
_YEAR = 365.0  # days
_OTHER = "technology"
_GROUPS = {
    "robot_drives": "robots",
    "line_stand_by": "stand_by",
    "factory_environment": "infrastructure",
}
_WHOLE = 0.5  # %: shares of a line are rounded, their sum may be so far from 100


def table_1_shares() -> dict[str, float]:
    """The paper's Table I in four groups [%]: robots, stand_by, technology (welding, gluing, PLCs
    and their network), infrastructure (the factory's environment).
    """
    shares = {"robots": 0.0, "stand_by": 0.0, _OTHER: 0.0, "infrastructure": 0.0}
    for row in load_power_data().table_1:
        shares[_GROUPS.get(row.consumer, _OTHER)] += row.percent
    return shares


_TABLE_1 = table_1_shares()


@dataclass(frozen=True)
class Costs:
    """Price, shifts and grid, and the shares of a line's energy."""

    price: float = setting(
        0.20, "Price of a kilowatt-hour, taxes as you count them.", minimum=0.0, maximum=1e4
    )
    currency: str = setting("EUR", "Currency of the price.")
    grid: float = setting(
        0.35,
        "CO2 of the grid, for a mix of coal, gas and renewables.",
        unit="kg/kWh",
        minimum=0.0,
        maximum=10.0,
    )
    shift_hours: float = setting(8.0, "Length of a shift.", unit="h", minimum=0.1, maximum=24.0)
    shifts_per_day: float = setting(2.0, "Shifts a day.", minimum=0.1, maximum=24.0)
    days_per_year: float = setting(240.0, "Days of production a year.", minimum=1.0, maximum=366.0)
    parts_per_cycle: float = setting(
        1.0, "Parts that leave the cell with each cycle.", minimum=0.01, maximum=1e6
    )
    availability: float = setting(
        0.85, "Share of a shift in which cycles run one after the other.", minimum=0.01, maximum=1.0
    )
    first_shift: float = setting(
        6.0, "When the first shift of a day begins.", unit="h", minimum=0.0, maximum=24.0
    )
    night_from: float = setting(
        22.0, "When the price of the night begins.", unit="h", minimum=0.0, maximum=24.0
    )
    night_to: float = setting(6.0, "When it ends.", unit="h", minimum=0.0, maximum=24.0)
    price_night: float = setting(
        0.0, "Price of a kilowatt-hour at night; 0: as by day.", minimum=0.0, maximum=1e4
    )
    demand_price: float = setting(
        0.0,
        "Price of a kilowatt of the largest quarter of an hour, each year.",
        minimum=0.0,
        maximum=1e6,
    )
    engineer_hour: float = setting(
        60.0, "What an hour of an engineer costs.", minimum=0.0, maximum=1e4
    )
    line_robots: float = setting(
        _TABLE_1["robots"],
        "Robots' share of the energy of the line with its hall; this and the next three are by "
        "default Table I of the paper and add up to 100.",
        unit="%",
        minimum=0.0,
        maximum=100.0,
    )
    line_stand_by: float = setting(
        _TABLE_1["stand_by"], "Share of the line's stand-by.", unit="%", minimum=0.0, maximum=100.0
    )
    line_technology: float = setting(
        _TABLE_1[_OTHER],
        "Share of technology: welding, gluing, PLCs and their network.",
        unit="%",
        minimum=0.0,
        maximum=100.0,
    )
    line_infrastructure: float = setting(
        _TABLE_1["infrastructure"],
        "Share of the hall: light, air, heating.",
        unit="%",
        minimum=0.0,
        maximum=99.0,
    )
    given: tuple[str, ...] = setting((), "Names that a file gave; the others are assumptions.")

    def __post_init__(self) -> None:
        check_settings(self)
        if self.shift_hours * self.shifts_per_day > _DAY:
            raise InvalidValueError(
                f"shift_hours is {self.shift_hours:g} h and shifts_per_day "
                f"{self.shifts_per_day:g}: together they must be at most {_DAY:g} h a day"
            )
        if abs(sum(self.line.values()) - 100.0) > _WHOLE:
            named = ", ".join(f"line_{name} {share:g} %" for name, share in self.line.items())
            raise InvalidValueError(
                f"{named}: they add up to {sum(self.line.values()):g} %, must be 100 %; what a "
                "file does not name stays as in Table I, so name all that differ"
            )

    @property
    def follows_price(self) -> bool:
        """Whether a page shows its amounts at the price that its reader types."""
        return isinstance(self.currency, Repriced)

    @property
    def line(self) -> dict[str, float]:
        """Shares [%] of the energy of a line with its hall, by consumer."""
        return {
            "robots": self.line_robots,
            "stand_by": self.line_stand_by,
            "technology": self.line_technology,
            "infrastructure": self.line_infrastructure,
        }

    @property
    def production_hours(self) -> float:
        """Hours of shifts in a year."""
        return self.shift_hours * self.shifts_per_day * self.days_per_year

    @property
    def standing_hours(self) -> float:
        """Hours of a year within the shifts in which no cycle runs."""
        return self.production_hours * (1.0 - self.availability)

    @property
    def idle_hours(self) -> float:
        """Hours of a year outside of the shifts: nights, weekends and holidays."""
        return max(_YEAR * _DAY - self.production_hours, 0.0)

    @property
    def production_price(self) -> float:
        """Mean price of a kilowatt-hour in the shifts."""
        hours = self.shift_hours * self.shifts_per_day
        return self._mean_price(self._night_hours(self.first_shift, hours), hours)

    @property
    def idle_price(self) -> float:
        """Mean price of a kilowatt-hour outside of the shifts."""
        worked = self._night_hours(self.first_shift, self.shift_hours * self.shifts_per_day)
        night = self._night_hours(0.0, _DAY) * _YEAR - worked * self.days_per_year
        return self._mean_price(max(night, 0.0), self.idle_hours)

    def _mean_price(self, night: float, hours: float) -> float:
        share = min(night / hours, 1.0) if hours > 0.0 else 0.0
        cheap = self.price_night or self.price
        return self.price * (1.0 - share) + cheap * share

    def _night_hours(self, start: float, hours: float) -> float:
        """Hours at night within `hours` (at most 24) from `start` on."""
        length = (self.night_to - self.night_from) % _DAY
        nights = (self.night_from + _DAY * day for day in (-1, 0, 1))
        return sum(
            max(min(start + hours, night + length) - max(start, night), 0.0) for night in nights
        )

    def money(self, energy: float) -> float:
        """Price of so many joules in the shifts."""
        return energy / J_PER_KWH * self.production_price

    def co2(self, energy: float) -> float:
        """kg of CO2 for so many joules."""
        return energy / J_PER_KWH * self.grid

    def cycles_per_shift(self, seconds: float) -> float:
        """Cycles of so many seconds in a shift."""
        return self.shift_hours * 3600.0 * self.availability / seconds

    def cycles_per_year(self, seconds: float) -> float:
        """Cycles of so many seconds in a year."""
        return self.cycles_per_shift(seconds) * self.shifts_per_day * self.days_per_year

    def energy_of_year(self, cycle: Production) -> Amount:
        """Joules of a year of such cycles, one after the other."""
        amount = Amount(cycle.energy, cycle.low, cycle.high)
        return amount.times(self.cycles_per_year(cycle.pace))

    def saving_of_year(self, cycle: Production) -> Amount | None:
        """Joules of a year that the plan saves, predicted: of as many cycles as the year of the
        cycle has; None where it is not known.
        """
        if cycle.savings is None:
            return None
        return saved_amount(cycle.savings.total).times(self.cycles_per_year(cycle.pace))

    def common_of_year(self, cycle: Production) -> float | None:
        """Joules of as many cycles of the program that the plan is held against; None where it is
        not known.
        """
        if cycle.savings is None:
            return None
        return cycle.savings.total.common * self.cycles_per_year(cycle.pace)


def following_price(costs: Costs) -> Costs:
    """The same, whose amounts a page shows at the price that its reader types; as they are where
    the night has a price of its own, and amounts are in proportion to none.
    """
    if costs.price_night > 0.0 or costs.price <= 0.0:
        return costs
    return replace(costs, currency=Repriced(costs.currency))


SETTINGS: tuple[Setting, ...] = tuple(each for each in describe(Costs) if each.name != "given")
NAMES = tuple(each.name for each in SETTINGS)
_WORDS = ("currency",)


def read_costs(path: str | Path, roots: FileRoots = ANYWHERE) -> Costs:
    """The costs of a file below `roots`; RecorderError with the key that is wrong."""
    try:
        tree = plain_yaml(roots.inside(path))
    except DescriptionFileError as error:
        raise RecorderError(str(error)) from error
    except (IrError, OSError) as error:
        raise RecorderError(f"{path}: {error}") from error
    if not isinstance(tree, dict) or tree.get("format") != FORMAT:
        raise RecorderError(f"{path}: is no file of costs, which begins with format: {FORMAT}")
    values = {str(key): value for key, value in tree.items() if key != "format"}
    for key, value in values.items():
        values[key] = _checked(f"{path}: {key[:40]}", key, value)
    try:
        return replace(Costs(), **values, given=tuple(values))
    except IrError as error:
        raise RecorderError(f"{path}: {error}") from error


def _checked(where: str, key: str, value: object) -> float | str:
    if key not in NAMES:
        raise RecorderError(f"{where} is unknown, known are {', '.join(NAMES)}")
    if key in _WORDS:
        if (
            not isinstance(value, str)
            or not 0 < len(value.strip()) <= _CURRENCY_MAX
            or not value.isprintable()
        ):
            raise RecorderError(
                f"{where} must be a text of at most {_CURRENCY_MAX} characters in one line"
            )
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        example = f": write {value.replace(',', '.')}" if _with_comma(value) else ""
        raise RecorderError(f"{where} is {str(value)[:40]!r}, it must be a number{example}")
    return float(value)


def _with_comma(value: object) -> TypeGuard[str]:
    """Whether a text is a number whose decimals follow a comma."""
    return isinstance(value, str) and re.fullmatch(r"-?\d{1,12},\d{1,12}", value) is not None


# What a cycle costs and what its plan saves: joules, money and CO2 per part, per shift and per
# year.


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


def computed_words(*cycles: Production) -> str:
    """How much of cycles that were driven nobody drove, and what that is from; "" where all of it
    was.
    """
    rests = [cycle.computed for cycle in cycles if cycle.computed is not None]
    if not rests:
        return ""
    part = share(sum(rest.energy for rest in rests), sum(cycle.energy for cycle in cycles))
    bases = dict.fromkeys(cycle.basis for cycle in cycles if cycle.computed is not None)
    return f"{part} of it computed: {rests[0].name}, {' and '.join(bases)}"


def origin_of(cycle: Production) -> str:
    """Whether a cycle was simulated, measured or predicted, and what of it was computed."""
    computed = computed_words(cycle)
    return f"{cycle.origin}, {computed}" if computed else cycle.origin


DRIVEN = "as driven"
"""What a year of a cycle that was driven is called."""


def driven_detail(cycle: Production) -> str:
    """What such a year is of; its full pauses are named, where nobody drove them."""
    pauses = "" if cycle.computed is None else ", full pauses computed"
    return f"{cycle.origin}{pauses}"


def own_pace(cycle: Production | None) -> str:
    """That a plan's steps are those of the program as fast as pays, where its money is of the same
    stops in the common program's time, and how far they are apart; "" elsewhere.
    """
    if cycle is None or cycle.own is None:
        return ""
    sooner = seconds(cycle.seconds - cycle.own.seconds)
    word, energy = Amount.of_value(cycle.energy - cycle.own.energy).gain()
    less = "less" if word == "saved" else "more"
    return (
        f"Steps, motion and charts are of the planned program as fast as pays: {sooner} sooner "
        f"and {kilowatt_hours(energy.value)} {less} a cycle than in the common program's time, "
        "which all money is of."
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


def idle_money(energy: float, costs: Costs) -> str:
    """Price of so many joules outside of the shifts."""
    return money(energy / J_PER_KWH * costs.idle_price, costs.currency)


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


# What the amounts rest on: a sentence where they stand, and all settings as a table.


def counted_with(costs: Costs) -> str:
    """The settings that move every amount of a year in a sentence (HTML), with the way to all of
    them.
    """
    own = set(NAMES) & set(costs.given)
    origin = "as your file gives it" if own == set(NAMES) else "partly assumed"
    words = (
        f"Counted with {_setting(costs, 'price')}, {costs.shifts_per_day:g} shifts of "
        f"{costs.shift_hours:g} h on {costs.days_per_year:g} days a year, "
        f"{100.0 * costs.availability:g} % of them in cycles, "
        f"{origin if own else 'all assumed'}"
    )
    return (
        f'{text(words)}<a class="screen" href="#assumed">: all values, and how to give yours</a>. '
        f"{_stands(costs)}{ROUNDED}"
    )


ROUNDED = "Each figure is rounded by itself: a sum may differ from its parts in its last digit."
"""How figures are rounded, on every page that has a sum."""


def _stands(costs: Costs) -> str:
    """The hours that no amount of a year counts, in a sentence; "" where there are none."""
    hours = costs.standing_hours
    if hours < _SHORT:
        return ""
    part = 100.0 * hours / costs.production_hours
    return (
        f"Not counted, before or after: the {whole(hours)} h a year ({part:.3g} % of the shifts) "
        "in which the cell stands still within its shifts. "
    )


_SHORT = 0.5  # h a year: less is not said


def assumed_section(costs: Costs) -> str:
    """All settings, those that no file gave named as assumed, in a sentence where all are; it is
    left out of
    paper, where the sentence of `counted_with` stands.
    """
    own = set(NAMES) & set(costs.given)
    rows = [
        (
            f"{text(each.sentence)}<small>{each.name}</small>",
            f"<b>{text(_setting(costs, each.name))}</b>"
            + (
                f"<small>{'from your file' if each.name in own else 'assumed'}</small>"
                if own
                else ""
            ),
        )
        for each in SETTINGS
    ]
    return (
        '<details class="part listed"><summary><h2>What the money rests on</h2></summary>'
        '<p class="hint" id="assumed">To change a value, write its name and your value as a line '
        f"of a file that begins with <code>format: {FORMAT}</code>, as <code>price: 0.31</code>, "
        "and give the file with <code>--costs costs.yaml</code>."
        f"{'' if own else ' All values are assumed.'}</p>"
        f"{table(('what is counted', '>value'), rows, 'What the money rests on')}</details>"
    )


_MONEY_PER = {"price_night": "/kWh", "demand_price": "/kW", "engineer_hour": "/h"}


def _setting(costs: Costs, name: str) -> str:
    """A setting with its unit."""
    value = getattr(costs, name)
    if name == "price":
        return price_of(value, costs.currency)
    if name in _MONEY_PER:
        return f"{value:g} {costs.currency}{_MONEY_PER[name]}"
    unit = next(each.unit for each in SETTINGS if each.name == name)
    return value if isinstance(value, str) else f"{value:g} {unit}".strip()


# What to change first: the biggest levers and rest outside of the shifts, as a table.


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


# The robot around the clock: the largest quarter of an hour, rest outside of the shifts, payback.


def clock_section(analysis: Analysis, costs: Costs) -> str:
    """Section of the page; "" where no whole cycle is known."""
    cycle = production_of(analysis)
    if cycle is None:
        return ""
    return (
        '<section id="around"><h2>When nobody works</h2>'
        f"{_idle(analysis, costs)}"
        f'<p class="hint">{_demand(analysis, cycle, costs)}</p></section>'
    )


def _demand(analysis: Analysis, cycle: Production, costs: Costs) -> str:
    """The largest quarter of an hour, and its price where one is given."""
    found = recorded_demand(analysis, cycle, costs)
    price = demand_note(found.watts, costs)
    words = f", {price}" if price else "; demand_price gives it a price"
    limit = f" ({cycle.supply})" if cycle.supply else ""
    return (
        f"The largest quarter of an hour takes {watts(found.watts)} on average{limit}{text(words)}:"
        f" {text(found.words)}. {DEMAND_LEAVES_OUT}"
    )


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


ON_BRAKES = "on closed brakes"
"""How a robot rests outside of the shifts where nobody puts it into another mode."""


def demand_note(peak: float, costs: Costs) -> str:
    """What the largest quarter of an hour [W] costs a year; "" where its price isn't given."""
    if costs.demand_price <= 0.0:
        return ""
    return f"{money(peak / 1000.0 * costs.demand_price, str(costs.currency))} a year"


LEFT_ALONE = "STAND_ON_BRAKES"
"""The mode that a controller goes into by itself while nobody works."""
_TODAY = "<small>today: what the controller does if left alone</small>"


@dataclass(frozen=True)
class IdleSaving:
    """Money of a year outside of the shifts: the controller left alone, and in its deepest mode;
    and the power of both [W], through so many hours, each at a price. saves [W]: the difference
    with its interval. measured: whether both powers were.
    """

    mode: str
    watts_left_alone: float
    watts_deepest: float
    saves: Amount
    hours: float
    price: float
    measured: bool = False

    @property
    def energy(self) -> Amount:
        """What the deepest mode saves [J]."""
        return self.saves.times(self.hours * 3600.0)

    @property
    def money(self) -> Amount:
        """What the deepest mode saves."""
        return self.saves.of(self._money)

    @property
    def left_alone(self) -> float:
        """Money of the controller left alone."""
        return self._money(self.watts_left_alone)

    @property
    def deepest(self) -> float:
        """Money in the deepest mode."""
        return self._money(self.watts_deepest)

    def _money(self, watts: float) -> float:
        return watts * self.hours / 1000.0 * self.price

    @property
    def basis(self) -> str:
        """What the powers rest on, in words."""
        return rest_basis(measured=self.measured)

    @property
    def saved(self) -> float:
        """What the deepest mode saves, in money."""
        return self.money.value


@dataclass(frozen=True)
class SavedYear:
    """What is saved of a year in shifts and outside of them: money, and energy [J]."""

    money: Amount
    energy: Amount

    def with_energy(self, costs: Costs) -> str:
        """Energy and CO2 in words; "" where they go the other way than the money."""
        word, energy = self.energy.gain()
        if word != self.money.gain()[0]:
            return ""
        return f"{kilowatt_hours(energy.value)}, {kilograms(costs.co2(energy.value))} CO2"


def saved_year(saved: Amount, idle: IdleSaving | None, costs: Costs) -> SavedYear:
    """The saving in shifts [J] with that outside of them."""
    shifts = saved.of(costs.money)
    if idle is None:
        return SavedYear(shifts, saved)
    return SavedYear(shifts.plus(idle.money), saved.plus(idle.energy))


def idle_saving(
    watts_at_rest: Mapping[str, float],
    saves: Amount | None,
    costs: Costs,
    *,
    measured: bool = False,
) -> IdleSaving | None:
    """What hibernation saves outside of the shifts; None where a power of rest [W] is not known, or
    it saves nothing. saves [W]: over closed brakes. measured: whether the powers were.
    """
    known = {LEFT_ALONE, HIBERNATION} <= set(watts_at_rest)
    if not known or saves is None or costs.idle_hours <= 0.0:
        return None
    rests = watts_at_rest[LEFT_ALONE], watts_at_rest[HIBERNATION]
    found = IdleSaving(
        HIBERNATION.lower(), *rests, saves, costs.idle_hours, costs.idle_price, measured
    )
    return found if found.saved >= NOTHING else None


def recorded_idle_saving(analysis: Analysis, costs: Costs) -> IdleSaving | None:
    """The same of the robot of a recording, by its data."""
    measured = rest_measured(analysis)
    return idle_saving(idle_watts(analysis), rest_saving(analysis), costs, measured=measured)


def idle_sentence(found: IdleSaving | None, costs: Costs) -> str:
    """The same in words; "" without it."""
    if found is None:
        return ""
    return (
        f"Outside of shifts: {found.mode} instead of closing the brakes saves "
        f"{yearly_money(found.saved, costs.currency)} a year, {found.basis}."
    )


def how_to_hibernate(cell: Cell | None) -> str:
    """Who puts the robot into hibernation, how long that takes and what to look after; "" where the
    controller has no such input.
    """
    controller = None if cell is None else cell.robot.controller
    if controller is None or _HIB not in (bit.name for bit in controller.plc_inputs):
        return ""
    mode = controller.mode(HIBERNATION)
    return (
        f"How: the PLC sets the input {_HIB} of the controller when work ends "
        f"({mode.time_to_pause:g} s), and wakes it over the network "
        f"{mode.regular_time_to_operate:g} s before the next begins; meanwhile the controller "
        "isn't on the network, and one that isn't woken in time delays the first cycle."
    )


_HIB = "HIB"


def _idle(analysis: Analysis, costs: Costs) -> str:
    """What the robot draws while nobody works, by power mode."""
    found = idle_watts(analysis)
    if analysis.cell is not None and not analysis.cell.robot.controller.counted:
        return (
            '<p class="hint">What the robot takes when nobody works isn\'t known: its controller '
            "has no figures.</p>"
        )
    if not found or costs.idle_hours <= 0.0:
        return ""
    saving = recorded_idle_saving(analysis, costs)
    seconds_idle = costs.idle_hours * 3600.0
    rows = [
        (
            text(mode.replace("_", " ").lower()) + (_TODAY if mode == LEFT_ALONE else ""),
            watts(power),
            f"<b>{text(idle_money(power * seconds_idle, costs))}</b>"
            f"<small>{kilowatt_hours(power * seconds_idle)}</small>",
        )
        for mode, power in found.items()
    ]
    heads = ("when nobody works", ">power", ">a year")
    return (
        f"{table(heads, rows, 'When nobody works', COMPACT)}"
        f'<p class="hint">{significant(costs.idle_hours, 6)} hours a year lie outside of the '
        f"shifts, at machine home. {text(idle_sentence(saving, costs))} "
        f"{text(how_to_hibernate(analysis.cell))}</p>"
    )
