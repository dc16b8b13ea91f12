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
from ir_recorder.analysis.production import production_of
from ir_recorder.report.bars import joule_bars
from ir_recorder.report.charts import front_section
from ir_recorder.report.cycle_costs import costs_section, lever_section
from ir_recorder.report.data import page_data
from ir_recorder.report.files import write_output
from ir_recorder.report.headline import (
    answer,
    failing,
    notes,
    only_proved,
    run_tiles,
    source,
    subtitle,
    tiles,
    verdict,
)
from ir_recorder.report.methods import methods_section
from ir_recorder.report.money_text import with_elements
from ir_recorder.report.nights import clock_section
from ir_recorder.report.number_text import joules, text
from ir_recorder.report.prices import Costs, assumed_section, following_price
from ir_recorder.report.program_names import own_pace
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
    "flows": sankey_section,
    "tending": tending_section,
    "savings": savings_section,
    "methods": methods_section,
}

_ASSETS = files("ir_recorder") / "report" / "assets"
PAGE_START = b"<!doctype html>"
SCRIPTS = (
    "charts.js",
    "axes.js",
    "renderer.js",
    "motion.js",
    "player.js",
    "export.js",
    "price.js",
    "app.js",
)


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
    prices = following_price(costs or Costs())
    known = not math.isnan(analysis.safety_distance)
    drawn = analysis.safety_distance if known else (tolerances or Tolerances()).safety_distance
    name = analysis.cell.name if analysis.cell is not None else analysis.recording.path.stem
    data = page_data(analysis, drawn)
    controller = load_power_data() if analysis.cell is None else analysis.cell.robot.controller
    planned = analysis.recording.only_planned
    cycle = costs_section(analysis, prices)
    rest = clock_section(analysis, prices)
    parts = {
        "title": text(f"{name}: {_subject(analysis)}"),
        "name": text(f"{name}: {_subject(analysis)}"),
        "subtitle": subtitle(analysis),
        "source": source(analysis),
        "verdict": verdict(checks, analysis),
        "failing": failing(checks),
        "paid": answer(analysis, prices),
        "tiles": tiles(analysis, prices),
        "run": run_tiles(analysis),
        "costs": cycle if planned else folded(cycle, paper=analysis.savings is not None),
        "front": folded(front_section(analysis, front)),
        "levers": lever_section(analysis, prices),
        "assumed": assumed_section(prices),
        "around": rest if planned else folded(rest, paper=True),
        "line": folded(line_section(of_recording(analysis, prices), prices)),
        "engineers": _engineers(analysis, checks, joules(controller.dc_link_capacity_energy)),
        "pace": _pace(analysis),
        "unmoved": "" if _moves(analysis) else " hidden",
        "style": asset("page.css"),
        "data": data,
        "script": "\n".join(asset(script) for script in SCRIPTS),
        **{name: chart(analysis) for name, chart in CHARTS.items()},
    }
    parts |= {name: folded(parts[name]) for name in ("savings", "methods")}
    return filled(asset("page.html"), parts)


def filled(page: str, parts: Mapping[str, str]) -> str:
    """The page with each {{name}} replaced by its part, and its amounts of money by elements that
    follow the reader's price.
    """
    shown = {name: with_elements(part) for name, part in parts.items()}
    return re.sub(r"\{\{(\w+)\}\}", lambda match: shown[match[1]], page)


def _subject(analysis: Analysis) -> str:
    """What the page is about."""
    if not analysis.recording.never_driven:
        return "the recorded run"
    return f"the plan and what it {'costs' if analysis.savings is None else 'saves'}"


def _pace(analysis: Analysis) -> str:
    """That the motion is not at the pace that the money is of; "" elsewhere."""
    words = own_pace(production_of(analysis))
    return f'<p class="hint">{text(words)}</p>' if words else ""


def _moves(analysis: Analysis) -> bool:
    """Whether there may be a motion to show, or a cell to say why there is none: steps of a file
    without a run have no trajectories.
    """
    planned = analysis.recording.planned
    return not planned or any(step.trajectory is not None for step in planned)


def _engineers(analysis: Analysis, checks: Sequence[Finding], capacity: str) -> str:
    """What engineers look at, each part folded; one of which nothing was recorded is left out."""
    places = f"<h3>Stations</h3>{station_table(analysis)}"
    modes = f"<h3>Power modes</h3>{mode_table(analysis)}"
    parts = [
        fold(
            "Energy of each movement, by consumer",
            _consumers(analysis.axes),
            joule_bars(analysis.movements, analysis.axes),
        ),
        fold(
            "Steps of the program",
            _CARRIED.format(text(capacity), " Select a step to see it." if analysis.steps else ""),
            step_table(analysis),
            "steps",
            printed=analysis.recording.only_planned,
        ),
        fold("Stations and power modes", "", places + modes),
        fold(
            "Meter and positions",
            _MEASURED,
            measurement_table(agreement(analysis)),
            "measurements",
        ),
        fold("Power at rest", _RESTING, resting_table(analysis)),
    ]
    if not only_proved(checks, analysis):
        parts.append(fold("Checks", "", check_table(checks), "checks", kept=True))
        parts.append(fold("Warnings in the log", "", warning_table(analysis), kept=True))
    facts = notes(analysis) + fact_table(analysis)
    parts.append(fold("The file, and the settings of its run", "", facts))
    return "\n".join(part for part in parts if part)


def _consumers(axes: Sequence[str]) -> str:
    """Key of the bars: the controller, the axes by their labels, the brake resistor."""
    keys = "".join(f'<span><i class="key {label.lower()}"></i>{label}</span> ' for label in axes)
    return (
        '<p class="key-row"><span><i class="key base"></i>controller, drives, tool</span> '
        f'{keys}<span><i class="key dissipated"></i>brake resistor</span> '
        '<span><i class="key plan"></i>predicted</span> <span><i class="key net"></i>at the mains'
        '</span></p><p class="hint">Net energy of each consumer: right of zero what it took, left '
        "of zero what a braking axis returned to the others and to the capacitors. The figure "
        "beside a bar is the net energy from the mains: the sum of both sides, but for what stays "
        "in the capacitors.</p>"
    )


_CARRIED = (
    '<p class="hint">Predicted without losses that the data sheet puts at zero: they can only add, '
    "so most 90 % intervals lie above. Pauses include the way into their mode and back. Clearance: "
    "the least over all pairs that may not touch. Plans carry the capacitors' charge (up to {}) "
    "from step to step.{}</p>"
)
_MEASURED = (
    '<p class="hint">Direct: the power meter. Indirect: recorded positions alone, differentiated '
    "with a bandwidth of 16 Hz, with torques, losses and DC link by code of the analysis and the "
    "figures of the data sheet; what differs is the robot, not the arithmetic. A variant takes "
    "recorded torques.</p>"
)
_RESTING = (
    '<p class="hint">Expected by the data of controller, tool and robot. Table II of the paper '
    "applies only where the load is the paper's tool or none.</p>"
)


def fold(
    head: str, hint: str, body: str, name: str = "", *, kept: bool = False, printed: bool = False
) -> str:
    """A part that opens when its heading is chosen, printed or not; "" where its body (HTML) shows
    neither a table nor bars, unless it is kept.
    """
    if not kept and "<table" not in body and 'class="row"' not in body:
        return ""
    own = f' id="{name}"' if name else ""
    kind = "part paper" if printed else "part"
    title = f"<summary><h2>{text(head)}</h2></summary>"
    return f'<details class="{kind}"{own}>{title}{hint}{body}</details>'


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
