"""The report: one HTML file with everything in it, that opens offline in any browser."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from ir_description import load_power_data
from ir_msgs_py.savings import ProgramPoint
from ir_recorder.analysis import Analysis, Finding, Tolerances
from ir_recorder.analysis.indirect import agreement
from ir_recorder.report.bars import joule_bars
from ir_recorder.report.charts import front_section
from ir_recorder.report.costs import (
    Costs,
    assumed_section,
    clock_section,
    costs_section,
    lever_section,
)
from ir_recorder.report.data import page_data
from ir_recorder.report.files import write_output
from ir_recorder.report.headline import (
    answer,
    failing,
    notes,
    run_tiles,
    source,
    subtitle,
    tiles,
    verdict,
)
from ir_recorder.report.methods import methods_section
from ir_recorder.report.number_text import joules, text
from ir_recorder.report.sankey import sankey_section
from ir_recorder.report.tables import (
    check_table,
    fact_table,
    measurement_table,
    mode_table,
    problem_list,
    resting_table,
    savings_section,
    station_table,
    step_table,
    warning_table,
)
from ir_recorder.report.tending import tending_section
from ir_recorder.report.whole_line import line_section, of_recording
from ir_values.files import ANYWHERE, FileRoots

# Charts and tables that the page shows of an analysis: a new one is a function, and a line here.
#
# The page (assets/page.html) holds the place of each as {{name}}.

Chart = Callable[[Analysis], str]
"""HTML or SVG of an analysis, whatever is missing in it; texts of the recording are escaped."""

CHARTS: Mapping[str, Chart] = {
    "problems": lambda analysis: problem_list(analysis.problems),
    "bars": lambda analysis: joule_bars(analysis.movements),
    "flows": sankey_section,
    "steps": step_table,
    "tending": tending_section,
    "savings": savings_section,
    "methods": methods_section,
    "stations": station_table,
    "modes": mode_table,
    "resting": resting_table,
    "measurements": lambda analysis: measurement_table(agreement(analysis)),
    "warnings": warning_table,
    "facts": fact_table,
}

_ASSETS = files("ir_recorder") / "report" / "assets"
PAGE_START = b"<!doctype html>"
SCRIPTS = ("charts.js", "axes.js", "renderer.js", "motion.js", "player.js", "export.js", "app.js")


def write_report(
    analysis: Analysis,
    checks: Sequence[Finding],
    path: str | Path,
    tolerances: Tolerances | None = None,
    roots: FileRoots = ANYWHERE,
    costs: Costs | None = None,
    front: Sequence[ProgramPoint] = (),
) -> Path:
    """Writes the page below `roots`, in place of another page but of no other file; its absolute
    path.

    RecorderError when it can't be written.
    """
    page = report_html(analysis, checks, tolerances, costs, front).encode()
    return write_output(path, page, PAGE_START, roots)


def report_html(
    analysis: Analysis,
    checks: Sequence[Finding],
    tolerances: Tolerances | None = None,
    costs: Costs | None = None,
    front: Sequence[ProgramPoint] = (),
) -> str:
    """The page as text, with the checks to show; without `costs` with those that are assumed.
    front: of the program, as it was planned.

    The chart of clearances shows the recorded safety distance, else that of the tolerances.
    """
    prices = costs or Costs()
    known = not math.isnan(analysis.safety_distance)
    drawn = analysis.safety_distance if known else (tolerances or Tolerances()).safety_distance
    name = analysis.cell.name if analysis.cell is not None else analysis.recording.path.stem
    shown = "what the plan saves" if analysis.recording.never_driven else "the recorded run"
    controller = load_power_data() if analysis.cell is None else analysis.cell.robot.controller
    parts = {
        "title": text(f"{name}: {shown}"),
        "name": text(f"{name}: {shown}"),
        "subtitle": subtitle(analysis),
        "source": source(analysis),
        "verdict": verdict(checks, analysis),
        "failing": failing(checks),
        "notes": notes(analysis),
        "paid": answer(analysis, prices),
        "tiles": tiles(analysis, prices),
        "run": run_tiles(analysis),
        "capacity": text(joules(controller.dc_link_capacity_energy)),
        "costs": costs_section(analysis, prices),
        "front": folded(front_section(analysis, front)),
        "levers": lever_section(analysis, prices),
        "assumed": assumed_section(prices),
        "around": clock_section(analysis, prices),
        "line": line_section(of_recording(analysis, prices), prices),
        "checks": check_table(checks),
        "style": asset("page.css"),
        "data": page_data(analysis, drawn),
        "script": "\n".join(asset(script) for script in SCRIPTS),
        **{name: chart(analysis) for name, chart in CHARTS.items()},
    }
    parts |= {name: folded(parts[name]) for name in ("savings", "methods")}
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], asset("page.html"))


def folded(section: str, *, paper: bool = False) -> str:
    """A section that opens when its heading is chosen: what an engineer looks at. paper: it is
    printed all the same.
    """
    kind = "part paper" if paper else "part"
    return re.sub(
        r"<section( id=\"[\w-]+\")?><h2>(.*?)</h2>(.*)</section>",
        rf'<details class="{kind}"\1><summary><h2>\2</h2></summary>\3</details>',
        section,
        flags=re.DOTALL,
    )


def asset(name: str) -> str:
    """A file of the page's parts as text."""
    return (_ASSETS / name).read_text(encoding="utf-8")
