"""Writes the figures in README.md: what `ir compare demo` says, rounded, and the span of the table
beside OMPL in docs/planning.md.

A test compares. The planner's clock stands, so that no busy machine cuts a plan.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from ir_msgs_py.savings import BeforeAfter
from ir_planner import Planner
from ir_planner.before_after import before_after_common
from ir_recorder.analysis.production import Amount
from ir_recorder.report.before_after import Year, year_of
from ir_recorder.report.money_text import money
from ir_recorder.report.number_text import millimetres, seconds, significant
from ir_recorder.report.prices import Costs

PAGE = Path(__file__).resolve().parents[1] / "README.md"
PEERS = PAGE.parent / "docs" / "planning.md"
START = "| | point to point at 100 % | planned | |\n"
END = "\n\n"


def compared() -> BeforeAfter:
    """The demonstration's program against PTP at 100 %."""
    planner = Planner("demo", clock=lambda: 0.0)
    start = planner.cell.posture(planner.cell.cycle_start())
    return before_after_common(planner, (), start)


def figures(found: BeforeAfter, costs: Costs) -> str:
    """The table, without the empty line after it."""
    today = found.today
    planned = found.planned
    free = next(side for side in found.sides if side.name == "free")
    now, then = (year_of(found, side, costs) for side in (today, planned))
    saving = planned.saving
    within = [f"{end / 3600.0:.0f}" for end in (saving.saved_low, saving.saved_high)]
    sooner = today.report.duration - free.report.duration
    rows = (
        (
            "cycle",
            seconds(today.report.duration),
            seconds(planned.report.duration),
            f"or {sooner:.0f} s shorter for the same energy",
        ),
        (
            "energy from the mains",
            *(f"{side.report.energy / 3600.0:.0f} Wh" for side in (today, planned)),
            f"{100.0 * saving.share:.0f} % less: {saving.saved / 3600.0:.0f} Wh, "
            f"at 90 % between {within[0]} and {within[1]}",
        ),
        (
            "a year, two shifts",
            _price(now.energy, costs),
            _price(then.energy, costs),
            f"{_price(then.saved, costs)} and {_co2(then, costs)} of CO2 less",
        ),
        (
            "peak power",
            *(f"{side.report.peak_power / 1e3:.1f} kW" for side in (today, planned)),
            "",
        ),
        (
            "minimum clearance",
            *(millimetres(side.report.min_clearance) for side in (today, planned)),
            "proved" if planned.certified else "not certified",
        ),
    )
    lines = (" | ".join(("", *row, "")).strip() for row in rows)
    return "\n".join((START + "|---|---|---|---|", *lines)).replace("|  |", "| |")


def _price(amount: Amount, costs: Costs) -> str:
    return money(costs.money(amount.value), costs.currency)


def _co2(year: Year, costs: Costs) -> str:
    return f"{significant(costs.co2(year.saved.value), 3)} kg"


def beside_peers(table: str) -> str:
    """What a movement takes and saves, smallest to largest cell of the table beside OMPL."""
    row = r"^\| `\w+` \| [^|]+ \| [\d.]+, (\d+) ms \|.*\| ([\d.]+), [\d.]+ to [\d.]+ \|$"
    found = re.findall(row, table, re.MULTILINE)
    final = sorted(int(ms) for ms, _ in found)
    saved = sorted(round(100.0 * (1.0 - float(ratio))) for _, ratio in found)
    return f"{final[0]} to {final[-1]} ms and costs {saved[0]} to {saved[-1]} %"


def page() -> str:
    """README.md with the figures of this build."""
    before, _, after = PAGE.read_text(encoding="utf-8").partition(START)
    after = after.partition(END)[2]
    peers = beside_peers(PEERS.read_text(encoding="utf-8"))
    after = re.sub(r"\d+ to \d+ ms and costs \d+ to \d+ %", peers, after)
    return before + figures(compared(), Costs()) + END + after


def main() -> int:
    """Writes README.md."""
    PAGE.write_text(page(), encoding="utf-8")
    sys.stdout.write(f"{PAGE}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
