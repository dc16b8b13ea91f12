"""A saving of the robots as a share of the whole line and of the factory.

The shares are those of Table I of the paper, or one's own.
"""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.savings import Saving
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.production import Amount, production_of, saved_amount
from ir_recorder.report.number_text import text
from ir_recorder.report.prices import Costs
from ir_recorder.report.tables import COMPACT, table

_NAMES = {
    "robots": "robots",
    "stand_by": "line stand-by",
    "technology": "technology (welding, gluing, PLCs)",
    "infrastructure": "infrastructure (the hall)",
}


@dataclass(frozen=True)
class WholeLine:
    """What a saving of the robots is of more than robots, each in percent with its 90 % interval.

    robots: of their own energy; line: of all consumers of the line without the hall; factory: with
    the hall. shares [%]: of each consumer before, all together 100; after [%]: of the same whole,
    with the saving. Consumers other than robots stay as they are: a robot that works better does
    not make a welding gun or the hall take less, and stand-by of the line's other machines is not
    that of its robots.
    """

    robots: Amount
    line: Amount
    factory: Amount
    shares: dict[str, float]
    after: dict[str, float]

    @property
    def sentence(self) -> str:
        """All of it in words, with the limit that the shares set."""
        word = self.line.gain()[0]
        robots = f"{self.shares['robots']:g} %"
        return (
            f"of the whole line, if every robot saved this: {with_ends(self.robots)} {word} "
            f"of the robots' energy is {with_ends(self.line)} of the line's and "
            f"{with_ends(self.factory)} of the factory's, where robots take {robots} and the "
            f"hall {self.shares['infrastructure']:g} %: no plan of robots saves more than their "
            f"{robots}, and none of the hall's"
        )


def with_ends(share: Amount) -> str:
    """A saved share as people say it, with its 90 % interval where there is one."""
    _, amount = share.gain()
    shown = f"{amount.value:.1f} %"
    return f"{shown} ({amount.low:.1f} to {amount.high:.1f})" if amount.low < amount.high else shown


def of_whole_line(saved: Amount, robots: float, costs: Costs) -> WholeLine | None:
    """What `saved` of the energy `robots` [J] of the robots, at the mains with their pauses, is of
    the line and of the factory; None where they take nothing.
    """
    if robots <= 0.0:
        return None
    shares = costs.line
    whole = sum(shares.values())
    own = saved.times(100.0 / robots)
    factory = own.times(shares["robots"] / whole)
    line = own.times(shares["robots"] / (whole - shares["infrastructure"]))
    after = {**shares, "robots": shares["robots"] * (1.0 - own.value / 100.0)}
    return WholeLine(own, line, factory, shares, after)


def of_saving(saving: Saving, costs: Costs) -> WholeLine | None:
    """The same of a program's saving; None as well where it is open whether anything is saved."""
    saved = saved_amount(saving)
    return None if saved.doubt else of_whole_line(saved, saving.common, costs)


def of_recording(analysis: Analysis, costs: Costs) -> WholeLine | None:
    """The same of a recording's plan; None where it says nothing of a saving."""
    cycle = production_of(analysis)
    if cycle is None or cycle.savings is None or cycle.drives_only:
        return None
    return of_saving(cycle.savings.total, costs)


def line_section(found: WholeLine | None, costs: Costs) -> str:
    """The saving among all consumers of a line of such robots, as a section of a page; "" where
    there is none.
    """
    if found is None:
        return ""
    rows = [
        (_NAMES[name], _percent(share), f"<b>{_percent(found.after[name])}</b>")
        for name, share in found.shares.items()
    ]
    before = sum(found.shares.values())
    after = sum(found.after.values())
    hall = found.shares["infrastructure"]
    for name, less in (("the line, without its hall", hall), ("the factory", 0.0)):
        cells = (f"<b>{name}</b>", _percent(before - less), f"<b>{_percent(after - less)}</b>")
        rows.append(cells)
    own = [name for name in costs.given if name.startswith("line_")]
    origin = (
        "Shares as your file gives them."
        if own
        else "Shares as they were measured on one production line; "
        '<a href="#assumed">how to give those of your line</a>.'
    )
    word = "less" if found.line.gain()[0] == "saved" else "more"
    hint = (
        f"If every robot moved and stood as this one does, and took {with_ends(found.robots)} "
        f"{word}, the line would take {with_ends(found.line)} {word}, and the factory with its "
        f"hall {with_ends(found.factory)} {word}. Robots that stand less save less."
    )
    heads = ("consumer", ">today", ">as planned")
    return (
        '<section id="whole-line"><h2>If a whole line did the same</h2>'
        f'<p class="hint">{text(hint)} {origin}</p>'
        f"{table(heads, rows, 'Of the whole line', COMPACT)}</section>"
    )


def _percent(share: float) -> str:
    return f"{share:.1f} %"
