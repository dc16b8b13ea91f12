"""Programs of today against the planner's: PTP at 100 %, an old one with detours, a trace, a
seam.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from _results import Claim, at_least, line_of
from _shop_round_trip import STOPPED

from ir_cli.trace_programs import today_of_trace
from ir_krl import follow, parse
from ir_msgs_py.report import MovementKind
from ir_msgs_py.savings import BeforeAfter
from ir_planner import Planner
from ir_planner.before_after import before_after, before_after_common, today_of_krl
from ir_planner.krl import evaluate_krl, tool_in_flange

TRACES = Path(__file__).resolve().parents[1] / "examples" / "traces"
ALONG = 0.01  # that the tool may be faster along a seam: what the speed of a path may differ by
LINE = 1.2  # times today's cycle time: what the line needs
VISIT = ("home", "infeed_pick", "gauge_measure", "home")
OLD = """DEF OLD( )
PTP XHOME
PTP {A1 10,A2 -80,A3 80,A4 0,A5 40,A6 0}
PTP {A1 35,A2 -95,A3 75,A4 0,A5 60,A6 0}
WAIT SEC 5
PTP {A1 0,A2 -110,A3 110,A4 0,A5 30,A6 0}
PTP {A1 -60,A2 -95,A3 80,A4 0,A5 60,A6 0}
$OUT[3]=TRUE
WAIT SEC 40
PTP XHOME
END
"""
SEAM = """DEF SEAM( )
PTP XHOME
PTP {A1 10,A2 -80,A3 80,A4 0,A5 40,A6 0}
WAIT SEC 3
PTP {A1 30,A2 -90,A3 90,A4 0,A5 30,A6 0}
$VEL.CP=0.5
LIN_REL {Z -100}
$OUT[5]=TRUE
$VEL.CP=0.06
$APO.CDIS=5
LIN_REL {X 150} C_DIS
CIRC_REL {X 35.3553,Y 14.6447},{X 50,Y 50} C_DIS
LIN_REL {Y 150}
$OUT[5]=FALSE
$VEL.CP=0.5
LIN_REL {Z 150}
PTP {A1 -60,A2 -95,A3 80,A4 0,A5 60,A6 0}
$OUT[3]=TRUE
WAIT SEC 20
PTP XHOME
END
"""


@dataclass(frozen=True)
class Row:
    """A side of a comparison: seconds, joules and what is saved, with the ends of its 90 %
    interval; along_s: seconds that the tool works along paths.
    """

    baseline: str
    side: str
    seconds: float
    joules: float
    joules_low: float
    joules_high: float
    saved_percent: float
    saved_low: float
    saved_high: float
    peak_w: float
    along_s: float
    certified: bool
    process_s: float


def baselines() -> tuple[list[dict[str, Any]], list[Claim]]:
    """Rows of all sides, and what is claimed of them."""
    rows = [row for name, run in RUNS.items() for row in _rows(name, run)]
    for row in rows:
        print(line_of(asdict(row)), flush=True)
    planned = [row for row in rows if row.side != "today"]
    same = [row for row in planned if row.side == "same cycle time"]
    claims = [
        at_least(
            "planned programs certified",
            sum(row.certified for row in planned) / len(planned),
            "share",
            1.0,
        ),
        at_least(
            "saved at the same cycle time, least of four",
            min(r.saved_percent for r in same),
            "%",
            5.0,
        ),
        at_least(
            "lower end of that interval, least of four", min(r.saved_low for r in same), "J", 0.0
        ),
        at_least("seconds along the seam over today's, least", _along(rows), "share", 1.0 - ALONG),
    ]
    return [asdict(row) for row in rows], claims


def _along(rows: list[Row]) -> float:
    """Seconds that planned programs work along the seam over today's, the least of them."""
    own = [row.along_s for row in rows if row.baseline == "a seam"]
    return min(own[1:]) / own[0]


def _rows(name: str, run: Any) -> list[Row]:
    began = time.process_time()
    seconds = run(0.0).today.report.duration
    found: BeforeAfter = run(LINE * seconds)
    took = time.process_time() - began
    return [
        Row(
            name,
            side.name,
            side.report.duration,
            side.report.energy,
            side.report.energy_low,
            side.report.energy_high,
            100.0 * side.saving.share,
            side.saving.saved_low,
            side.saving.saved_high,
            side.report.peak_power,
            sum(step.duration for step in side.movements if step.kind == MovementKind.CARTESIAN),
            side.certified,
            took,
        )
        for side in (found.today, *found.sides)
    ]


def _planner(cell: str) -> Planner:
    return Planner(cell, clock=STOPPED)


def _common(cycle_time: float) -> BeforeAfter:
    planner = _planner("demo")
    return before_after_common(planner, VISIT, planner.cell.machine_home, cycle_time)


def _krl(text: str, cycle_time: float) -> BeforeAfter:
    planner = _planner("open")
    cell = planner.cell
    program = follow([parse(text, "old.src")], cell.machine_home, tool_in_flange(cell.tcp))
    return before_after(planner, today_of_krl(evaluate_krl(planner, program)), cycle_time)


def _old(cycle_time: float) -> BeforeAfter:
    return _krl(OLD, cycle_time)


def _seam(cycle_time: float) -> BeforeAfter:
    return _krl(SEAM, cycle_time)


def _trace(cycle_time: float) -> BeforeAfter:
    planner = _planner("open")
    options = argparse.Namespace(
        mapping=TRACES / "rsi_log.yaml", load="", bandwidth=0.0, between=None
    )
    return before_after(
        planner, today_of_trace(options, planner, TRACES / "rsi_log.csv"), cycle_time
    )


RUNS = {"PTP at 100 %": _common, "an old program": _old, "a trace": _trace, "a seam": _seam}
