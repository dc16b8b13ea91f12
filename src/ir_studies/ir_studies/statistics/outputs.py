"""What statistics leave behind: a table with a row per movement, and the page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from ir_msgs_py.file_roots import ANYWHERE
from ir_recorder.report.files import write_output
from ir_recorder.report.page import PAGE_START
from ir_recorder.report.step_table import write_columns
from ir_recorder.report.tables import table
from ir_recorder.report.words import DASH, text
from ir_studies.page import page
from ir_studies.statistics.dots import dots
from ir_studies.statistics.figures import (
    ASYNCHRONOUS,
    SYNCHRONOUS,
    Comparison,
    Findings,
    number,
)
from ir_studies.statistics.settings import StatisticsSettings
from ir_studies.statistics.verdict import sentences, signed
from ir_studies.work import Row

_CSV_START = b"pair,"
_NUMBERS = (
    "duration_s", "predicted_j", "predicted_low_j", "predicted_high_j", "direct_j", "indirect_j", "drives_j",
    "peak_w", "path_m", "movement_cost", "torque_share",
)  # fmt: skip
_TEXTS = ("timing", "trajectory_id", "message")
_HEADS = ("", ">pairs", ">mean", ">90 % interval", ">median", ">less in", ">effect d")


def write_outputs(
    rows: Sequence[Row], found: Findings, settings: StatisticsSettings, folder: Path
) -> tuple[Path, ...]:
    """Write table.csv and index.html. Raises RecorderError for files that can't be written, or replaced."""
    html = page_html(found, settings).encode()
    return (
        write_columns(columns(rows), folder / "table.csv", _CSV_START, ANYWHERE),
        write_output(folder / "index.html", html, PAGE_START, ANYWHERE),
    )


def columns(rows: Sequence[Row]) -> dict[str, list[str | float | int]]:
    """A row per pair and timing, SI units."""
    flat = list(_flat(rows))
    return {name: [each[name] for each in flat] for name in flat[0]} if flat else {}


def _flat(rows: Sequence[Row]) -> Iterator[dict[str, str | float | int]]:
    for k, row in enumerate(rows):
        for asked in (SYNCHRONOUS, ASYNCHRONOUS):
            one = row.get(asked, {"message": row.get("message", "")})
            yield {
                "pair": k,
                "start": str(row.get("start", "")),
                "goal": str(row.get("goal", "")),
                "asked": asked,
                "solved": int(bool(one.get("solved", False))),
                **{name: number(one, name) for name in _NUMBERS},
                **{name: str(one.get(name, "")) for name in _TEXTS},
            }


def page_html(found: Findings, settings: StatisticsSettings) -> str:
    """The page as text."""
    parts = {
        "title": "Statistics",
        "subtitle": text(
            f"{settings.cell}: {found.pairs} random pairs, planner {settings.planner or 'portfolio'}, "
            f"objective {settings.objective}, plant {settings.plant}"
        ),
        "said": "".join(f"<li>{text(sentence)}</li>" for sentence in sentences(found)),
        "comparisons": _table(found.comparisons, "Asynchronous against synchronous"),
        "comparison_dots": dots(found.comparisons, "Asynchronous against synchronous, pair by pair"),
        "agreements": _table(found.agreements, "Energies of a movement"),
        "agreement_dots": dots(found.agreements, "Against direct, movement by movement"),
        "settings": text(settings.budget),
    }
    return page("statistics", parts)


def _table(comparisons: Sequence[Comparison], caption: str) -> str:
    return table(_HEADS, [_row(each) for each in comparisons], caption)


def _row(each: Comparison) -> tuple[str, ...]:
    interval = f"{signed(each.mean.low)} to {signed(each.mean.high)}" if each.count > 1 else DASH
    return (
        text(each.name),
        str(each.count),
        f"<b>{signed(each.mean.value)}</b>" if each.shown else signed(each.mean.value),
        interval,
        signed(each.median),
        f"{100.0 * each.less:.0f} %" if each.count else DASH,
        f"{each.effect:+.2f}" if each.effect == each.effect else DASH,
    )
