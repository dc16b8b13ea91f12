"""The biggest levers as a table: joules, share, money a year, and what would save them."""

from __future__ import annotations

from ir_recorder.analysis import Analysis
from ir_recorder.analysis.levers import levers
from ir_recorder.report.costs import Costs
from ir_recorder.report.money import cycle_of, money
from ir_recorder.report.tables import table
from ir_recorder.report.words import joules, share, text


def lever_section(analysis: Analysis, costs: Costs) -> str:
    """Section of the page; "" where no lever is known."""
    found = levers(analysis)
    program = analysis.program
    cycle = cycle_of(analysis)
    if not found or program is None or cycle is None:
        return ""
    yearly = costs.cycles_per_year(cycle.seconds)
    rows = (
        (
            text(lever.name),
            f"at most <b>{joules(lever.joules)}</b>",
            share(lever.joules, program.whole.energy),
            text(money(costs.money(lever.joules * yearly), costs.currency)),
            f"{text(lever.means)}<small>counted: {text(lever.basis)}</small>",
        )
        for lever in found
    )
    heads = ("lever", ">joules of this run", ">share", ">a year, at most", "what would save them")
    return (
        '<section id="levers"><h2>The biggest levers</h2><p class="hint">Upper bounds from '
        "figures of this "
        "run, each by itself: together they count some joules twice.</p>"
        f"{table(heads, rows, 'The biggest levers')}</section>"
    )
