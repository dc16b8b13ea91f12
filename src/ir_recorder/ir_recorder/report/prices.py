"""What joules cost, from a file or as assumed: prices by day and night and of the peak, the
calendar of shifts, and the grid's CO2; and how a page says what it is counted with.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeGuard

from ir_description import DescriptionFileError, load_power_data
from ir_description.files import plain_yaml
from ir_recorder.analysis.production import (
    Amount,
    Production,
    saved_amount,
)
from ir_recorder.errors import RecorderError
from ir_recorder.report.money_text import (
    Repriced,
    price_of,
)
from ir_recorder.report.number_text import (
    text,
    whole,
)
from ir_recorder.report.tables import table
from ir_values.errors import InvalidValueError, IrError
from ir_values.files import ANYWHERE, FileRoots
from ir_values.settings import Setting, check_settings, describe, setting

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
        f'{text(words)}<span class="screen">: <a href="#assumed">all values, and how to give yours'
        "</a></span>. "
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
