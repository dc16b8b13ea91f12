"""The top of every page for those who pay: a year before and after as bars, what the plan saves of
it, what rest outside of the shifts saves, and both together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ir_recorder.analysis.production import Amount
from ir_recorder.report.answer import Answer
from ir_recorder.report.bars import Piece, Row, bars
from ir_recorder.report.costs import (
    Costs,
    IdleSaving,
    SavedYear,
    assumed_prices,
    money_of,
    money_of_thousand,
    payback,
    saved_year,
    together,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.number_text import text, watts


@dataclass(frozen=True)
class Tile:
    """One figure: its name, the value, and lines that explain it."""

    name: str
    value: str
    notes: tuple[str, ...]

    def html(self) -> str:
        """As an element of the page."""
        notes = "".join(f"<small>{text(note)}</small>" for note in self.notes if note)
        return f'<div class="tile"><span>{text(self.name)}</span><b>{text(self.value)}</b>{notes}</div>'  # noqa: E501


MOVEMENTS = "movements as planned"
PAUSES = "pauses in the planned power modes"
"""What a plan saves with, in words."""
CERTIFIED = "No collision: certified by bounds at every instant, not by samples."
"""How a planned program is proved."""
COMMON = "common program"
"""What plans are held against where nobody gave today's program."""
_ROUNDED = " Each amount is rounded by itself."
_COMMON = " Common program: the same stations by PTP at 100 %, its pauses left to the controller."


@dataclass(frozen=True)
class Paid:
    """What those who pay ask first. saved [J] a year by the plan, of `common` [J]; None where it is
    not known; idle: outside of the shifts. counted: what the year is
    made of, in words; before: what it is held against. driven: what else a year of it is called,
    and what that takes [J]: nothing is known of its nights, so they are as before. supply: what
    limits the figures. proved: whether the planned program is certified. run: what was driven, in
    a sentence. more: what else the plan gains.
    """

    saved: Amount | None
    common: float
    idle: IdleSaving | None
    counted: str = ""
    before: str = "today"
    driven: tuple[str, float] | None = None
    supply: str = ""
    proved: bool = False
    run: str = ""
    more: str = ""

    def answer(
        self, costs: Costs, steps: Sequence[Step], part: tuple[float, float] | None = None
    ) -> Answer:
        """What a page says first; the saving must be known. part [J]: what a part took and takes
        then.
        """
        year = self.year(costs)
        word, gain = year.money.gain()
        less = "less" if word == "saved" else "more"
        nights = 0.0 if self.idle is None else self.idle.left_alone
        today = together((costs.money(self.common), nights))
        energy = year.with_energy(costs)
        share = f"{_percent(gain.value, today)} of {yearly_money(today, costs.currency)}"
        said = (f"{energy} {less}" if energy else "", share, payback(year.money, costs), self.more)
        result = f"{yearly_money(gain.value, costs.currency)} {less} a year"
        if self.saved is not None and self.saved.doubt:
            result = f"Open whether anything is saved: {result}"
        words = "; ".join(each for each in said if each)
        return Answer(
            result,
            f"{words}.",
            self.sure(costs),
            first_steps(steps, self.idle, costs) or "Keep the program as it is.",
            [*_of_parts(part, costs), *a_night(self.idle, costs), f"{assumed_prices(costs)}."],
        )

    def sure(self, costs: Costs) -> str:
        """How sure a saving is: its interval, and what each part of it rests on."""
        said = []
        if self.saved is not None:
            between = _between(self.year(costs).money.gain()[1], costs)
            said += [
                f"{between}, of the robot's data alone." if between else "",
                self.supply,
                "What plans save is predicted.",
            ]
        said.append(self.run)
        if self.idle is not None:
            late = "a robot that is woken late delays the first cycle"
            said.append(f"What nights save is {self.idle.basis}; {late}.")
        if self.proved:
            said.append(CERTIFIED)
        return " ".join(each for each in said if each)

    def picture(self, costs: Costs) -> str:
        """A year before and after; "" where the saving isn't known."""
        if self.saved is None:
            return ""
        nights = (0.0, 0.0) if self.idle is None else (self.idle.left_alone, self.idle.deepest)
        shifts = costs.money(self.common), costs.money(self.common - self.saved.value)
        rows = [
            _year_row(self.before, "today", (shifts[0], nights[0]), costs),
            _year_row("as planned", "planned", (shifts[1], nights[1]), costs),
        ]
        if self.driven is not None:
            name, energy = self.driven
            rows.append(_year_row(name, "driven", (costs.money(energy), nights[0]), costs))
        saved = self.year(costs).money
        between = _between(saved, costs)
        if saved.value > 0.0:
            rows.append(self._saved_row(saved, between, costs))
        pale = " Pale: at night and at weekends." if self.idle is not None else ""
        whisker = " Whisker: 90 % interval of what is saved." if between else ""
        common = _COMMON if self.before == COMMON else ""
        hint = f"In full colour: in shifts{self.counted}.{pale}{whisker}{common}{_ROUNDED}"
        return (
            f'<section id="year"><h2>Energy costs of a year</h2>'
            f'{bars(rows, "energy costs of a year")}<p class="hint">{text(hint)}</p></section>'
        )

    def _saved_row(self, saved: Amount, between: str, costs: Costs) -> Row:
        """What is saved of a year, with the whisker of its interval."""
        name = "saved as planned"
        nights = 0.0 if self.idle is None else self.idle.saved
        pieces = (
            Piece("saved", f"{name} in shifts", saved.value - nights),
            Piece("saved night", f"{name} at night and at weekends", nights),
        )
        price = yearly_money(saved.value, costs.currency)
        return Row(name, pieces, price, (between,), whisker=(saved.low, saved.high))

    def year(self, costs: Costs) -> SavedYear:
        """What is saved of a year in all; what isn't known counts as nothing."""
        return saved_year(self.saved or Amount(0.0, 0.0, 0.0), self.idle, costs)


Step = tuple[Amount, str]
"""Something to do: what it saves a year in money, and words."""
_FEW = 3  # to do, at the top of a page


def first_steps(steps: Sequence[Step], idle: IdleSaving | None, costs: Costs) -> list[str]:
    """The steps that save most, and rest outside of the shifts among them."""
    found = [step for step in steps if step[0].value >= _WORTH]
    if idle is not None:
        found.append((idle.money, at_night(idle)))
    found.sort(key=lambda step: -step[0].value)
    return [
        f"{words[0].upper()}{words[1:]}: {with_span(money, costs)} a year"
        for money, words in found[:_FEW]
    ]


def at_night(idle: IdleSaving) -> str:
    """What to do outside of the shifts, with the power before and after."""
    return (
        f"{idle.mode} ({watts(idle.watts_deepest)}) instead of closed brakes "
        f"({watts(idle.watts_left_alone)}) at night and at weekends"
    )


def with_span(money: Amount, costs: Costs) -> str:
    """An amount of a year, its 90 % interval in brackets."""
    shown = money_of(money, costs.currency)
    return f"{shown} ({yearly_span(money.low, money.high)})" if money.low < money.high else shown


_WORTH = 0.01  # of a currency, a year: less is no step


def _of_parts(part: tuple[float, float] | None, costs: Costs) -> list[str]:
    if part is None:
        return []
    before, then = (money_of_thousand(joules, costs) for joules in part)
    return [f"1 000 parts: {then.partition(' for')[0]} instead of {before.partition(' for')[0]}"]


def a_night(idle: IdleSaving | None, costs: Costs) -> list[str]:
    """What rest between the shifts of two days costs, and from the last of a week to the first of
    the next, in words; none where shifts follow each other.
    """
    night = 24.0 - costs.shift_hours * costs.shifts_per_day
    rests = [("night", night)] if night > 0.0 else []
    if costs.days_per_year <= _WORK_DAYS:
        rests.append(("weekend", night + 48.0))
    if idle is None:
        return []
    return [
        f"A {name} of {hours:g} h: {_rest_of(hours, idle.deepest, idle, costs)} instead of "
        f"{_rest_of(hours, idle.left_alone, idle, costs)}"
        for name, hours in rests
    ]


_WORK_DAYS = 365.0 * 5.0 / 7.0  # days of production a year: with more, weekends are worked


def _rest_of(hours: float, year: float, idle: IdleSaving, costs: Costs) -> str:
    """So many hours' part of the money of a year outside of the shifts."""
    return yearly_money(hours / idle.hours * year, costs.currency)


def _year_row(
    name: str,
    style: str,
    money: tuple[float, float],
    costs: Costs,
) -> Row:
    """A bar of a year: money in shifts, and outside of them."""
    shifts, nights = (yearly_money(each, costs.currency) for each in money)
    pieces = [Piece(style, f"in shifts {shifts}", money[0])]
    parts = ""
    if money[1] > 0.0:
        pieces.append(Piece(f"{style} night", f"at night and at weekends {nights}", money[1]))
        parts = f"{shifts} in shifts, {nights} outside"
    price = yearly_money(together(money), costs.currency)
    return Row(name, tuple(pieces), price, (parts,))


def row_of(tiles: Sequence[Tile]) -> str:
    """Figures beside each other."""
    return f'<section class="tiles">{"".join(tile.html() for tile in tiles)}</section>'


def _percent(part: float, whole: float) -> str:
    return f"{100.0 * part / whole:.1f} %" if whole > 0.0 else ""


def _between(price: Amount, costs: Costs) -> str:
    if price.high <= price.low:
        return ""
    return f"90 % interval {yearly_span(price.low, price.high)} {costs.currency}"
