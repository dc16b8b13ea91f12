"""The top of every page for those who pay: a year before and after as bars, what the plan saves of
it, what rest outside of the shifts saves, and both together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from ir_recorder.analysis.production import Amount
from ir_recorder.report.answer import Answer
from ir_recorder.report.bars import Piece, Row, bars
from ir_recorder.report.cycle_costs import payback
from ir_recorder.report.money_text import (
    NOTHING,
    money,
    price_field,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.nights import IdleSaving, SavedYear, saved_year
from ir_recorder.report.number_text import text, watts
from ir_recorder.report.prices import Costs
from ir_recorder.report.program_names import COMMON, ON_BRAKES, PLANNED, TODAY


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


MOVEMENTS = "movements of the planned program"
PAUSES = "pauses in the planned power modes"
"""What a plan saves with, in words."""
CERTIFIED = "No collision: certified by bounds at every instant, not by samples."
"""How a planned program is proved."""
SAVED = "saved"
REACHED = "reached"
LEFT = "still to save"
"""Rows of a year: what the planned program saves, or how much less than the common program was
driven, and what is left.
"""
ABOVE = "find what the run takes above its plan"
"""What to do about a run that took more than its plan predicts."""
ABOVE_LEAST = 0.01  # of the common program: less is nothing to look for
_COMMON = " Common program: the same stations by PTP at 100 %, its pauses left to the controller."


class Before(StrEnum):
    """What a plan is held against, by its name on a page: today's program, or what stands for it,
    of one robot or of several.
    """

    TODAY = TODAY
    COMMON = COMMON
    COMMONS = f"{COMMON}s"


@dataclass(frozen=True)
class RunNow:
    """What runs now: its name on a page, and what a year of it takes [J]; detail: what else its row
    says. is_planned: a plan, which nobody drove.
    """

    name: str
    energy: float
    detail: str = ""
    is_planned: bool = False


@dataclass(frozen=True)
class Paid:
    """What those who pay ask first. saved [J] a year by the plan, of `common` [J]; None where it is
    not known; idle: outside of the shifts. counted: what the year is
    made of, in words; before: what it is held against. driven: what runs now: nothing is known of
    its nights, so they are as before. supply: what limits the figures. proved: whether the planned
    program is certified. run: what was driven, in a sentence. more: what else the plan gains.
    reached [J]: how much less than `common` was driven (`reached_saving`); None where nothing was.
    """

    saved: Amount | None
    common: float
    idle: IdleSaving | None
    counted: str = ""
    before: Before = Before.TODAY
    driven: RunNow | None = None
    supply: str = ""
    proved: bool = False
    run: str = ""
    more: str = ""
    reached: Amount | None = None

    def answer(
        self, costs: Costs, steps: Sequence[Step], part: tuple[float, float] | None = None
    ) -> Answer:
        """What a page says first; the saving must be known. steps: what the plan saves with; part
        [J]: what a part took and takes then.
        """
        year = self.year(costs)
        less = _less(year.money)
        energy = year.with_energy(costs)
        share = self.share_words(costs)
        said = (share, f"{energy} {less}" if energy else "", payback(year.money, costs), self.more)
        result = f"{self.gain_words(costs)} {less} a year"
        if self.saved is not None and self.saved.doubt:
            result = f"Open whether anything is saved: {result}"
        reached = self.has_reached
        if reached is not None:
            result = self.reached_words(costs)
        words = "; ".join(each for each in said if each)
        own = [f"{step}, predicted" for step in first_steps(steps, None, costs)]
        nights = first_steps(self._above_steps(costs), self.idle, costs)
        return Answer(
            result,
            f"{words[0].upper()}{words[1:]}.",
            self.sure(costs, self._above(costs)),
            nights if reached is not None else first_steps(steps, self.idle, costs) or KEEP,
            [*_of_parts(part, costs), *a_night(self.idle, costs)],
            self.between_words(costs),
            own if reached is not None else (),
            counted_at(costs),
            self.bills(costs),
        )

    @property
    def has_reached(self) -> Amount | None:
        """What was driven of a saving that is one; None elsewhere."""
        saves = self.saved is not None and self.saved.value > 0.0 and not self.saved.doubt
        return self.reached if saves else None

    def _above_steps(self, costs: Costs) -> list[Step]:
        """What a run took above its plan, as something to do; none where that is little."""
        above = self._above(costs)
        if above <= 0.0 or above < ABOVE_LEAST * costs.money(self.common):
            return []
        return [(Amount.of_value(above), ABOVE)]

    def _above(self, costs: Costs) -> float:
        """Money of a year that a run took more than its plan; 0 where nothing was driven."""
        if self.driven is None or self.saved is None:
            return 0.0
        return costs.money(self.driven.energy - (self.common - self.saved.value))

    def share_words(self, costs: Costs) -> str:
        """How much less a year of the plan takes than what it is held against: "57.8 % less than
        the common program".
        """
        money = self.year(costs).money
        _, gain = money.gain()
        all_of_it = "with all of it " if self.has_reached is not None else ""
        share = percent_of(gain.value, sum(self.before_amounts(costs)))
        return f"{all_of_it}{share} {_less(money)} than {_with_article(self.before)}"

    def bills(self, costs: Costs) -> list[tuple[str, str]]:
        """What a year costs, nights with it: of what the plan is held against, of what was driven,
        and of the plan; empty where no saving is known.
        """
        if self.saved is None or self.common <= 0.0:
            return []
        before = self.before_amounts(costs)
        found = [(str(self.before), sum(before))]
        if self.driven is not None:
            found.append((self.driven.name, costs.money(self.driven.energy) + before[1]))
        found.append((planned_name(self.before), sum(self._then(costs))))
        return [(name, f"{yearly_money(each, costs.currency)} a year") for name, each in found]

    def between_words(self, costs: Costs) -> str:
        """The interval of all that is saved; where a part of it was reached, whose it is."""
        between = between_of(self.year(costs).money.gain()[1], costs)
        if self.has_reached is None or not between:
            return between
        return f"{self.gain_words(costs)}: {between}"

    def gain_words(self, costs: Costs) -> str:
        """What is saved of a year in all, or taken more, in money."""
        return yearly_money(abs(self.year(costs).money.value), costs.currency)

    def reached_words(self, costs: Costs) -> str:
        """How much of a saving was driven: "105 EUR of 323 EUR a year reached"."""
        reached = self.has_reached
        assert reached is not None
        mine = costs.money(reached.value)
        if mine < NOTHING:
            return f"Nothing of {self.gain_words(costs)} a year reached"
        shown = yearly_money(mine, costs.currency)
        if self.year(costs).money.value - mine < NOTHING:
            return f"{shown} less a year: reached"
        return f"{shown} of {self.gain_words(costs)} a year reached"

    def _then(self, costs: Costs) -> tuple[float, float]:
        """Money of a year of the plan: in shifts, and outside of them where that is known."""
        saved = 0.0 if self.saved is None else self.saved.value
        nights = 0.0 if self.idle is None else self.idle.deepest
        return costs.money(self.common - saved), nights

    def before_amounts(self, costs: Costs) -> tuple[float, float]:
        """Money of a year before: in shifts, and outside of them where that is known."""
        nights = 0.0 if self.idle is None else self.idle.left_alone
        return costs.money(self.common), nights

    def sure(self, costs: Costs, above: float = 0.0) -> list[str]:
        """How sure a saving is: what its interval is of, and what each part of it rests on; above:
        money of a year that runs took more than their plans.
        """
        said = []
        if self.saved is not None:
            limit = f"; {self.supply}" if self.supply else ""
            spread = f"; {OF_DATA}" if self._spreads(costs) else ""
            said.append(f"What plans save is predicted{spread}{limit}.")
        if self.has_reached is not None:
            said.append(f"Reached: the {self.before}, predicted, less what was driven.")
            said.append(_above_words(above, costs))
        said.append(self.run)
        if self.idle is not None:
            late = "a robot that is woken late delays the first cycle"
            said.append(f"What nights save is {self.idle.basis}; {late}.")
        if self.proved:
            said.append(CERTIFIED)
        return [each for each in said if each]

    def _spreads(self, costs: Costs) -> bool:
        money = self.year(costs).money
        return money.low < money.high

    def picture(self, costs: Costs) -> str:
        """A year before and after; "" where neither the saving nor what rest saves is known."""
        rows = self._rows(costs) if self.saved is not None else self._rows_of_nights(costs)
        if not rows:
            return ""
        pale = " Pale: at night and at weekends." if self.idle is not None else ""
        spread = any(row.whisker[0] < row.whisker[1] for row in rows)
        whisker = " Whisker: 90 % interval." if spread else ""
        common = "" if self.before is Before.TODAY else _COMMON
        hint = f"In full colour: in shifts{self.counted}.{pale}{whisker}{common}"
        return (
            f'<section id="year"><h2>Energy costs of a year</h2>'
            f'{bars(rows, "energy costs of a year")}<p class="hint">{text(hint)}</p></section>'
        )

    def _rows(self, costs: Costs) -> list[Row]:
        """The programs, and what is saved: what was reached and what is left, where it was
        driven.
        """
        assert self.saved is not None
        before = self.before_amounts(costs)
        then = self._then(costs)
        rows = [_year_row(self.before, "today", before, costs, ON_BRAKES)]
        if self.driven is not None:
            now = costs.money(self.driven.energy), before[1]
            rows.append(_year_row(_row_name(self.driven), "driven", now, costs, ON_BRAKES))
        mode = "" if self.idle is None else f"in {self.idle.mode}"
        rows.append(_year_row(planned_name(self.before), "planned", then, costs, mode))
        saved = self.year(costs).money
        reached = self.has_reached
        idle = 0.0 if self.idle is None else self.idle.saved
        if reached is not None:
            mine = reached.of(costs.money)
            if mine.value >= NOTHING:
                rows.append(_saved_row(REACHED, mine, 0.0, costs))
            left = Amount(saved.value - mine.value, saved.low - mine.low, saved.high - mine.high)
            if left.value >= NOTHING:
                rows.append(_saved_row(LEFT, left, min(idle, left.value), costs))
        elif saved.value > 0.0:
            rows.append(_saved_row(SAVED, saved, idle, costs))
        return rows

    def _rows_of_nights(self, costs: Costs) -> list[Row]:
        """A year of what was driven or planned, and what rest would save of it."""
        if self.driven is None or self.idle is None:
            return []
        idle = self.idle
        name = _row_name(self.driven)
        shifts = costs.money(self.driven.energy)
        style = "today" if self.driven.is_planned else "driven"
        how = f"in {idle.mode}"
        return [
            _year_row(name, style, (shifts, idle.left_alone), costs, ON_BRAKES),
            _year_row(name, "planned", (shifts, idle.deepest), costs, how),
            _saved_row(LEFT, idle.money, idle.saved, costs),
        ]

    def year(self, costs: Costs) -> SavedYear:
        """What is saved of a year in all; what isn't known counts as nothing."""
        return saved_year(self.saved or Amount(0.0, 0.0, 0.0), self.idle, costs)


def _less(money: Amount) -> str:
    """Whether a plan takes less or more, of what it saves."""
    return "less" if money.value >= 0.0 else "more"


def _row_name(now: RunNow) -> str:
    """What runs now, as its row is called."""
    return f"{now.name}, {now.detail}" if now.detail else now.name


def _with_article(before: Before) -> str:
    """What a plan is held against, in a sentence: today's program has its own word before it."""
    return before if before is Before.TODAY else f"the {before}"


def planned_name(before: Before) -> str:
    """What a year of the plan is called beside what it is held against."""
    return f"{PLANNED}s" if before is Before.COMMONS else PLANNED


KEEP = "Keep the program as it is."


OF_DATA = "its interval covers how uncertain the robot's data are, nothing else"
"""What the interval of a predicted saving is of."""


def _above_words(above: float, costs: Costs) -> str:
    """Where what was driven lies off its plan, and where that is counted; "" on its plan."""
    if abs(above) < NOTHING:
        return ""
    side, row = ("above", "still to save") if above > 0.0 else ("below", "reached")
    shown = yearly_money(abs(above), costs.currency)
    return f"Driven {shown} a year {side} the plan: counted as {row}."


def reached_saving(saved: Amount, common: float, driven: float) -> Amount:
    """How much less than the common program was driven [J]: with the interval of what its plan
    saves, about the value that was driven.
    """
    off = common - driven - saved.value
    return Amount(common - driven, saved.low + off, saved.high + off)


def counted_at(costs: Costs) -> str:
    """The price and the shifts that a year is counted with (HTML): the price is a field, which all
    amounts of the page follow.
    """
    own = {"price", "shift_hours", "shifts_per_day", "days_per_year"} <= set(costs.given)
    follow = "; type your own price, and every amount follows" if costs.follows_price else ""
    shifts = (
        f"{costs.shifts_per_day:g} x {costs.shift_hours:g} h on {costs.days_per_year:g} days a year"
        f"{'' if own else ', assumed'}"
    )
    return (
        f"{price_field(costs.price, costs.currency)}, {text(shifts)}"
        f'<span class="screen">{text(follow)}</span>.'
    )


def _saved_row(name: str, saved: Amount, nights: float, costs: Costs) -> Row:
    """What is saved of a year, with the whisker of its interval; nights: outside of shifts."""
    price = yearly_money(saved.value, costs.currency)
    pieces = (
        Piece("saved", f"{name} in shifts", saved.value - nights),
        Piece("saved night", f"{name} at night and at weekends", nights),
    )
    return Row(name, pieces, price, (between_of(saved, costs),), whisker=(saved.low, saved.high))


Step = tuple[Amount, str]
"""Something to do: what it saves a year in money, and words."""
_FEW = 3  # to do, at the top of a page


def first_steps(steps: Sequence[Step], idle: IdleSaving | None, costs: Costs) -> list[str]:
    """The steps that save most, and rest outside of the shifts among them."""
    found = [(money, words) for money, words in steps if money.value >= _WORTH]
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
    shown = yearly_money(money.value, costs.currency)
    return (
        f"{shown} ({yearly_span(money.low, money.high, costs.currency)})"
        if money.low < money.high
        else shown
    )


_WORTH = 0.01  # of a currency, a year: less is no step


def _of_parts(part: tuple[float, float] | None, costs: Costs) -> list[str]:
    if part is None:
        return []
    before, then = (money(1000.0 * costs.money(joules), costs.currency) for joules in part)
    return [f"1 000 parts: {then} instead of {before}"]


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
    rests: str,
) -> Row:
    """A bar of a year: money in shifts, and outside of them; rests: how, in words, which belongs
    to the name, as the same program with other nights is another year.
    """
    shifts, nights = (yearly_money(each, costs.currency) for each in money)
    pieces = [Piece(style, "in shifts", money[0])]
    parts = ""
    if money[1] > 0.0:
        pieces.append(Piece(f"{style} night", "at night and at weekends", money[1]))
        parts = f"{shifts} in shifts, {nights} outside"
        name = f"{name}, nights {rests}"
    price = yearly_money(sum(money), costs.currency)
    return Row(name, tuple(pieces), price, (parts,))


def row_of(tiles: Sequence[Tile]) -> str:
    """Figures beside each other."""
    return f'<section class="tiles">{"".join(tile.html() for tile in tiles)}</section>'


def percent_of(part: float, whole: float) -> str:
    """A part of a whole in percent; "" without a whole."""
    return f"{100.0 * part / whole:.1f} %" if whole > 0.0 else ""


def between_of(price: Amount, costs: Costs) -> str:
    """The 90 % interval of an amount of a year, in words; "" without one."""
    if price.high <= price.low:
        return ""
    ends = yearly_span(price.low, price.high, costs.currency)
    return f"90 % interval {ends} {costs.currency}"
