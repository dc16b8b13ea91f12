"""What statistics leave behind: a table with a row per movement, and the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from ir_msgs_py.file_roots import ANYWHERE
from ir_recorder.analysis.intervals import Mean
from ir_recorder.report.files import write_output
from ir_recorder.report.number_text import DASH, text
from ir_recorder.report.page import PAGE_START
from ir_recorder.report.step_table import write_columns
from ir_recorder.report.tables import table
from ir_studies.page import page
from ir_studies.statistics.dots import dots
from ir_studies.statistics.figures import Comparison, Findings
from ir_studies.statistics.settings import StatisticsSettings
from ir_studies.statistics.sides import ASYNCHRONOUS, SYNCHRONOUS, number
from ir_studies.statistics.verdict import sentences, signed
from ir_studies.work import Row

_CSV_START = b"pair,"
_NUMBERS = (
    "duration_s", "predicted_j", "predicted_low_j", "predicted_high_j", "direct_j", "indirect_j", "drives_j",  # noqa: E501
    "peak_w", "path_m", "movement_cost", "torque_share",
)  # fmt: skip
_TEXTS = ("timing", "trajectory_id", "message")
_HEADS = ("", ">pairs", ">mean difference, 90 %", ">median, 90 %", ">less / equal / more", ">d")
_SUMMED_UP = (
    "comparison", "pairs", "values", "mean_percent", "low_percent", "high_percent", "median_percent",  # noqa: E501
    "median_low_percent", "median_high_percent", "effect", "less", "more", "chance", "shown",
)  # fmt: skip


def write_outputs(
    rows: Sequence[Row], found: Findings, settings: StatisticsSettings, folder: Path
) -> tuple[Path, ...]:
    """Write table.csv and index.html. Raises RecorderError for files that can't be written, or
    replaced.
    """
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
            f"{settings.cell}: {found.pairs} random pairs, planner "
            f"{settings.planner or 'portfolio'}, "
            f"objective {settings.objective}, plant {settings.plant}"
        ),
        "said": "".join(f"<li>{text(sentence)}</li>" for sentence in sentences(found, settings)),
        "comparisons": _table(
            found.comparisons, "Asynchronous against synchronous", (">asynchronous", ">synchronous")
        ),
        "left_out": _left_out(found),
        "comparison_dots": dots(
            found.comparisons, "asynchronous less synchronous, in percent of synchronous"
        ),
        "agreements": _table(found.agreements, "Energies of a movement", (">energy", ">direct")),
        "agreement_dots": dots(
            found.agreements, "predicted or indirect less direct, in percent of direct"
        ),
        "settings": text(settings.budget),
    }
    return page("statistics", parts)


def summed_up(found: Findings) -> str:
    """A row of CSV per comparison; the differences are in percent of the second."""
    lines = [
        ",".join(
            str(value)
            for value in (
                f'"{each.name}"', each.pairs, each.count, each.mean.value, each.mean.low, each.mean.high,  # noqa: E501
                each.median.value, each.median.low, each.median.high, each.effect, each.less, each.more,  # noqa: E501
                each.chance, int(each.shown),
            )
        )
        for each in (*found.comparisons, *found.agreements)
    ]  # fmt: skip
    return "\n".join([",".join(_SUMMED_UP), *lines]) + "\n"


def _table(comparisons: Sequence[Comparison], caption: str, sides: tuple[str, str]) -> str:
    """sides: of what the means are. With a column of movements where these are more than the
    pairs.
    """
    rows = [_row(each) for each in comparisons]
    heads = [*_HEADS[:2], *sides, *_HEADS[2:]]
    if any(each.count != each.pairs for each in comparisons):
        heads.insert(1, ">movements")
        rows = [
            (row[0], str(each.count), *row[1:]) for row, each in zip(rows, comparisons, strict=True)
        ]
    return table(heads, rows, caption)


def _row(each: Comparison) -> tuple[str, ...]:
    equal = each.count - each.less - each.more
    return (
        text(each.name),
        str(each.pairs),
        *(f"{level:.4g} {each.unit}" if math.isfinite(level) else DASH for level in each.levels),
        _with_interval(each.mean, "b" if each.shown else "span"),
        _with_interval(each.median, "span"),
        f"{each.less} / {equal} / {each.more}" if each.count else DASH,
        f"{each.effect:+.2f}" if math.isfinite(each.effect) else DASH,
    )


def _with_interval(found: Mean, tag: str) -> str:
    value = f"<{tag}>{signed(found.value)}</{tag}>"
    if not math.isfinite(found.low):
        return value
    return (
        f"{value} ({signed(found.low).removesuffix(' %')} to "
        f"{signed(found.high).removesuffix(' %')})"
    )


def _left_out(found: Findings) -> str:
    """A section with the reasons; "" where nothing was left out."""
    if not found.failures:
        return ""
    rows = [(text(each.what), str(each.count), text(each.example)) for each in found.failures]
    reasons = table(("", ">how many", "why, one of them in words"), rows, "What was left out")
    return f'<section id="left_out"><h2>What was left out</h2>{reasons}</section>'
