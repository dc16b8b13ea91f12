"""The first row of every page for those who pay: what the plan saves a year, what rest outside of
the shifts saves, both together, and what that is of the line and of the factory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ir_recorder.analysis.production import Amount
from ir_recorder.report.costs import (
    Costs,
    IdleSaving,
    payback,
    share_between,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.number_text import kilowatt_hours, text
from ir_recorder.report.whole_line import WholeLine


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
    not known; idle: outside of the shifts; line: of more than robots. notes: lines of the first.
    robots: how many save it together.
    """

    saved: Amount | None
    common: float
    idle: IdleSaving | None
    line: WholeLine | None
    notes: tuple[str, ...] = ()
    robots: int = 1

    def tiles(self, costs: Costs) -> list[Tile]:
        """The figures that are known."""
        shown = [self._saved(costs), self._idle(costs), self._both(costs), self._line()]
        return [tile for tile in shown if tile is not None]

    def html(self, costs: Costs) -> str:
        """As a row of the page; "" where nothing is known."""
        shown = self.tiles(costs)
        return row_of(shown) if shown else ""

    def _saved(self, costs: Costs) -> Tile | None:
        if self.saved is None:
            return None
        word, gain = self.saved.gain()
        notes = (
            _between(gain.of(costs.money), costs),
            f"{_percent(gain.value, self.common)} {'less' if word == 'saved' else 'more'}, "
            f"{kilowatt_hours(gain.value)} a year",
            share_between(gain, self.common),
            gain.doubt,
            *self.notes,
            self._payback(self.saved, costs),
        )
        price = yearly_money(costs.money(gain.value), costs.currency)
        return Tile(f"{word} a year in shifts, by the plan", price, notes)

    def _payback(self, saved: Amount, costs: Costs) -> str:
        """When an hour of an engineer for each robot is paid back."""
        found = payback(saved.times(1.0 / self.robots), costs)
        return f"{found}, for each robot in the mean" if found and self.robots > 1 else found

    def _idle(self, costs: Costs) -> Tile | None:
        if self.idle is None:
            return None
        found = self.idle
        today, then = (
            yearly_money(cost, costs.currency) for cost in (found.left_alone, found.deepest)
        )
        return Tile(
            "saved a year at night and at weekends",
            yearly_money(found.saved, costs.currency),
            (
                f"{today} with the brakes closed ({found.watts_left_alone:.0f} W)",
                f"{then} in {found.mode} ({found.watts_deepest:.0f} W)",
            ),
        )

    def _both(self, costs: Costs) -> Tile | None:
        if self.saved is None or self.idle is None:
            return None
        night = self.idle.saved
        money = self.saved.of(costs.money)
        saved = Amount(money.value + night, money.low + night, money.high + night)
        word, gain = saved.gain()
        price = yearly_money(gain.value, costs.currency)
        today = costs.money(self.common) + self.idle.left_alone
        before, after = (
            yearly_money(cost, costs.currency) for cost in (today, today - saved.value)
        )
        share = f"{_percent(gain.value, today)} {'less' if word == 'saved' else 'more'}"
        notes = (_between(gain, costs), f"{after} instead of {before}: {share}")
        return Tile(f"{word} a year, both together", price, notes)

    def _line(self) -> Tile | None:
        if self.line is None:
            return None
        word, line = self.line.line.gain()
        factory = self.line.factory.gain()[1]
        return Tile(
            f"{'less' if word == 'saved' else 'more'} energy of the whole line",
            f"{line.value:.1f} %",
            (
                _percents(line),
                f"of the factory with its hall {factory.value:.1f} %",
                _percents(factory),
                "if every robot did the same, in shifts",
            ),
        )


def row_of(tiles: Sequence[Tile]) -> str:
    """Figures beside each other."""
    return f'<section class="tiles">{"".join(tile.html() for tile in tiles)}</section>'


def _percent(part: float, whole: float) -> str:
    return f"{100.0 * part / whole:.1f} %" if whole > 0.0 else ""


def _percents(share: Amount) -> str:
    if share.high <= share.low:
        return ""
    return f"90 % interval {share.low:.1f} to {share.high:.1f} %"


def _between(money: Amount, costs: Costs) -> str:
    if money.high <= money.low:
        return ""
    return f"90 % interval {yearly_span(money.low, money.high)} {costs.currency}"
