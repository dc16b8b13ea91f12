"""The top of every page for those who pay: a year before and after as bars, what the plan saves of
it, what rest outside of the shifts saves, and both together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ir_recorder.analysis.production import Amount
from ir_recorder.report.bars import Piece, Row, bars
from ir_recorder.report.costs import (
    Costs,
    IdleSaving,
    SavedYear,
    payback,
    saved_year,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.number_text import kilowatt_hours, text
from ir_recorder.report.whole_line import with_ends


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


@dataclass(frozen=True)
class Paid:
    """What those who pay ask first. saved [J] a year by the plan, of `common` [J]; None where it is
    not known; idle: outside of the shifts. counted: what the year is
    made of, in words; before: what it is held against. driven: what else a year of it is called,
    and what that takes [J]. supply: what limits the figures. robots: how many save it together.
    """

    saved: Amount | None
    common: float
    idle: IdleSaving | None
    counted: str = ""
    before: str = "today"
    driven: tuple[str, float] | None = None
    supply: str = ""
    robots: int = 1

    def tiles(self, costs: Costs) -> list[Tile]:
        """The figures that are known."""
        shown = [self._saved(costs), self._idle(costs), self._both(costs)]
        return [tile for tile in shown if tile is not None]

    def html(self, costs: Costs) -> str:
        """The picture and the row of figures; "" where nothing is known."""
        shown = self.tiles(costs)
        return self.picture(costs) + row_of(shown) if shown else ""

    def parts(self, costs: Costs) -> list[Tile]:
        """What is saved in shifts and outside of them, each by itself."""
        return [tile for tile in (self._saved(costs), self._idle(costs)) if tile is not None]

    def _headline(self, costs: Costs) -> str:
        """What is saved of a year in all, in money and energy."""
        year = self.year(costs)
        word, gain = year.money.gain()
        less = "less" if word == "saved" else "more"
        parts = (yearly_money(gain.value, costs.currency), year.with_energy(costs))
        head = f"{', '.join(part for part in parts if part)} {less} a year"
        if self.saved is not None and self.saved.doubt:
            return f"It is open whether anything is saved: {head}"
        return head

    def picture(self, costs: Costs, head: str = "") -> str:
        """A year before and after, with its message as the head unless there is another; "" where
        the saving isn't known.
        """
        if self.saved is None:
            return ""
        nights = (0.0, 0.0) if self.idle is None else (self.idle.left_alone, self.idle.deepest)
        shifts = costs.money(self.common), costs.money(self.common - self.saved.value)
        before = shifts[0] + nights[0]
        saved = self.year(costs).money
        ends = (before - saved.high, before - saved.low)
        sure = f"90 % interval {yearly_span(*ends)} {costs.currency}" if ends[0] < ends[1] else ""
        rows = [
            _year_row(self.before, "today", (shifts[0], nights[0]), costs),
            _year_row("as planned", "planned", (shifts[1], nights[1]), costs, ends, sure),
        ]
        if self.driven is not None:
            name, energy = self.driven
            rows.append(_year_row(name, "driven", (costs.money(energy), nights[1]), costs))
        pale = " Pale: at night and at weekends." if self.idle is not None else ""
        whisker = " Whisker: 90 % interval of what is saved." if sure else ""
        hint = f"Energy costs of a year. In full colour: in shifts{self.counted}.{pale}{whisker}"
        return (
            f'<section id="year"><h2>{text(head or self._headline(costs))}</h2>'
            f'{bars(rows, "energy costs of a year")}<p class="hint">{text(hint)}</p></section>'
        )

    def year(self, costs: Costs) -> SavedYear:
        """What is saved of a year in all; what isn't known counts as nothing."""
        return saved_year(self.saved or Amount(0.0, 0.0, 0.0), self.idle, costs)

    def _saved(self, costs: Costs) -> Tile | None:
        if self.saved is None:
            return None
        word, gain = self.saved.gain()
        energy = kilowatt_hours(gain.value)
        share = with_ends(gain.times(100.0 / self.common)) if self.common > 0.0 else ""
        less = "less" if word == "saved" else "more"
        notes = (
            _between(gain.of(costs.money), costs),
            f"{share} {less}, {energy}",
            gain.doubt,
            self.supply,
            payback(self.year(costs).money, costs) if self.idle is None else "",
        )
        price = yearly_money(costs.money(gain.value), costs.currency)
        return Tile(f"{word} a year in shifts, by the plan", price, notes)

    def _idle(self, costs: Costs) -> Tile | None:
        if self.idle is None:
            return None
        found = self.idle
        between = _between(found.money, costs)
        of = f", {self.robots} robots together" if self.robots > 1 else ""
        return Tile(
            "saved a year at night and at weekends",
            yearly_money(found.saved, costs.currency),
            (
                between,
                f"{found.mode} ({found.watts_deepest:.0f} W) instead of closed brakes "
                f"({found.watts_left_alone:.0f} W){of}",
                found.basis,
            ),
        )

    def _both(self, costs: Costs) -> Tile | None:
        if self.saved is None or self.idle is None:
            return None
        year = self.year(costs)
        word, gain = year.money.gain()
        price = yearly_money(gain.value, costs.currency)
        today = costs.money(self.common) + self.idle.left_alone
        share = f"{_percent(gain.value, today)} {'less' if word == 'saved' else 'more'}"
        notes = (_between(gain, costs), share, year.with_energy(costs), payback(year.money, costs))
        return Tile(f"{word} a year, both together", price, notes)


def _year_row(
    name: str,
    style: str,
    money: tuple[float, float],
    costs: Costs,
    whisker: tuple[float, float] = (math.nan, math.nan),
    between: str = "",
) -> Row:
    """A bar of a year: money in shifts, and outside of them."""
    shifts, nights = (yearly_money(each, costs.currency) for each in money)
    pieces = [Piece(style, f"in shifts {shifts}", money[0])]
    parts = ""
    if money[1] > 0.0:
        pieces.append(Piece(f"{style} night", f"at night and at weekends {nights}", money[1]))
        parts = f"{shifts} in shifts, {nights} outside"
    price = yearly_money(sum(money), costs.currency)
    return Row(name, tuple(pieces), price, (parts, between), whisker=whisker)


def row_of(tiles: Sequence[Tile]) -> str:
    """Figures beside each other."""
    return f'<section class="tiles">{"".join(tile.html() for tile in tiles)}</section>'


def _percent(part: float, whole: float) -> str:
    return f"{100.0 * part / whole:.1f} %" if whole > 0.0 else ""


def _between(money: Amount, costs: Costs) -> str:
    if money.high <= money.low:
        return ""
    return f"90 % interval {yearly_span(money.low, money.high)} {costs.currency}"
