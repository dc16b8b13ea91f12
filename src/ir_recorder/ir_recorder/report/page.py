"""The report: one HTML file with everything in it, that opens offline in any browser."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

from ir_description import load_power_data
from ir_recorder.analysis import Analysis, Finding, Tolerances
from ir_recorder.errors import PathError
from ir_recorder.format.contents import OWN_FACTS
from ir_recorder.report.charts import CHARTS
from ir_recorder.report.data import page_data
from ir_recorder.report.tables import check_table
from ir_recorder.report.words import joules, millimetres, number, percent, seconds, text, watts

_ASSETS = files("ir_recorder") / "report" / "assets"
SCRIPTS = ("charts.js", "renderer.js", "motion.js", "app.js")


def write_report(
    analysis: Analysis,
    checks: Sequence[Finding],
    path: str | Path,
    tolerances: Tolerances | None = None,
) -> Path:
    """Writes the page and returns its absolute path; PathError when it can't be written."""
    target = Path(path).absolute()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(report_html(analysis, checks, tolerances), encoding="utf-8")
    except OSError as error:
        raise PathError(f"{target} can't be written: {error.strerror}") from error
    return target


def report_html(analysis: Analysis, checks: Sequence[Finding], tolerances: Tolerances | None = None) -> str:
    """The page as text, with the checks to show; the tolerances give the safety distance of the chart."""
    bounds = tolerances or Tolerances()
    name = analysis.cell.name if analysis.cell is not None else analysis.recording.path.stem
    parts = {
        "title": text(f"{name} – report of a recording"),
        "name": text(name),
        "subtitle": _subtitle(analysis),
        "verdict": _verdict(checks),
        "notes": _notes(analysis),
        "tiles": _tiles(analysis, checks),
        "capacity": text(joules(load_power_data().dc_link_capacity_energy)),
        "checks": check_table(checks),
        "style": _asset("page.css"),
        "data": page_data(analysis, bounds.safety_distance),
        "script": "\n".join(_asset(script) for script in SCRIPTS),
        **{name: chart(analysis) for name, chart in CHARTS.items()},
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], _asset("page.html"))


def _subtitle(analysis: Analysis) -> str:
    recording = analysis.recording
    start = datetime.fromtimestamp(recording.start_ns * 1e-9, UTC)
    version = recording.fact("version")
    return text(
        f"{recording.path.name}, {start:%Y-%m-%d %H:%M:%S} UTC, {seconds(recording.duration)}"
        + (f", recorder {version}" if version else "")
    )


def _verdict(checks: Sequence[Finding]) -> str:
    failed = sum(not check.ok for check in checks)
    if not checks:
        return '<p class="verdict">Nothing could be checked.</p>'
    if failed:
        words = f"{failed} of {len(checks)} checks fail"
        return f'<p class="verdict bad"><a href="#checks">{words}</a></p>'
    return f'<p class="verdict good"><a href="#checks">All {len(checks)} checks hold</a></p>'


def _notes(analysis: Analysis) -> str:
    """Facts of this run from the recorder's parameter, as shortened transitions."""
    facts = [(key, value) for key, value in analysis.recording.facts if key not in OWN_FACTS]
    if not facts:
        return ""
    items = "".join(f"<li>{text(key.replace('_', ' '))} <b>{text(value)}</b></li>" for key, value in facts)
    return f'<ul class="notes"><li class="head">Settings of this run</li>{items}</ul>'


def _tiles(analysis: Analysis, checks: Sequence[Finding]) -> str:
    moved = analysis.movements
    least = min((r.clearance.least for r in moved if r.clearance is not None), default=math.nan)
    deviation = max(
        (abs(r.energy / r.step.movement.report.energy - 1.0) for r in moved if r.step.movement.report.energy),
        default=math.nan,
    )
    tiles = (
        ("energy at the mains", joules(analysis.energy), number(analysis.energy / 3600.0, "Wh")),
        ("recorded", seconds(analysis.seconds), f"mean {watts(analysis.mean_power)}"),
        ("peak power", watts(analysis.peak_power), "of a 10 ms reading"),
        (
            "movements",
            str(len(moved)),
            f"{joules(sum(r.energy for r in moved))} in {seconds(sum(r.seconds for r in moved))}",
        ),
        ("plan against measured", percent(deviation).lstrip("+"), "largest deviation of energy"),
        ("least clearance", millimetres(least), "executed, allowed contacts aside"),
    )
    return "".join(
        f'<div class="tile"><span>{text(name)}</span><b>{text(value)}</b><small>{text(note)}</small></div>'
        for name, value, note in tiles
    )


def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")
