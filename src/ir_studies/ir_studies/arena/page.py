"""The page of an arena: one HTML file with figures, distributions and pictures, styled as the report."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ir_description import load_cell
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.file_roots import ANYWHERE
from ir_recorder.report.axes import Curves, packed
from ir_recorder.report.files import write_output
from ir_recorder.report.front import Point, front_chart
from ir_recorder.report.page import PAGE_START, asset
from ir_recorder.report.series import Json
from ir_recorder.report.tables import table
from ir_recorder.report.words import DASH, joules, millimetres, percent, seconds, text
from ir_studies.arena.cell_picture import cell_picture
from ir_studies.arena.figures import (
    GRID,
    Figures,
    compared,
    cost_over_time,
    energy_and_time,
    figures,
    longest,
    of_cell,
    success_over_time,
)
from ir_studies.arena.settings import PORTFOLIO, ArenaSettings
from ir_studies.arena.table import Run
from ir_studies.page import BUTTON, page

SCRIPTS = ("charts.js", "axes.js", "export.js", "compare.js")
_HEADS = (
    "planner", ">solved", ">first answer", ">best answer", ">J above the best", ">W above the least",
    ">duration", ">energy", ">clearance", ">lost",
)  # fmt: skip
_TIE = 5e-5  # of J: less is not shown
_ABOVE = 300.0  # percent: what a curve of costs shows where nothing, or something dearer, is known


def write_page(runs: Sequence[Run], settings: ArenaSettings, path: Path) -> Path:
    """Write the page in place of another page; its absolute path. PathError when it can't be written."""
    return write_output(path, page_html(runs, settings).encode(), PAGE_START, ANYWHERE)


def page_html(runs: Sequence[Run], settings: ArenaSettings) -> str:
    """The page as text."""
    planners = settings.planners
    questions = len({run.entry.question for run in runs})
    parts = {
        "title": "Arena",
        "subtitle": text(
            f"{len(planners)} planners, {len(settings.cells)} cells, {questions} questions, "
            f"{settings.seeds} seed{'s' if settings.seeds > 1 else ''}: {len(runs)} runs of "
            f"{settings.seconds:g} s of processor"
        ),
        "verdict": verdict(runs, settings),
        "cells": "".join(_cell_section(runs, cell, planners) for cell in settings.cells),
        "settings": text(json.dumps(settings.budget)),
        "data": json.dumps(
            {"end": longest(runs), "axes": list(_curves(runs, settings))}, separators=(",", ":")
        ).replace("<", "\\u003c"),
        "script": "\n".join(asset(script) for script in SCRIPTS),
    }
    return page("arena", parts, BUTTON)


def verdict(runs: Sequence[Run], settings: ArenaSettings) -> str:
    """Whether the portfolio solved most and cost least in every cell, or where not."""
    if PORTFOLIO not in settings.planners or len(settings.planners) == 1:
        return ""
    said = [words for cell in settings.cells for words in _against(of_cell(runs, cell), cell, settings)]
    held = "In every cell the portfolio solved most, and nobody has a lower median J where both solved."
    items = "".join(f"<li>{text(words)}</li>" for words in said or [held])
    return f'<section id="verdict"><h2>The portfolio against the others</h2><ul>{items}</ul></section>'


def _against(own: Sequence[Run], cell: str, settings: ArenaSettings) -> Iterator[str]:
    found = {planner: figures(planner, own) for planner in settings.planners}
    mine = found[PORTFOLIO]
    for planner, other in found.items():
        if other.success > mine.success:
            yield f"{cell}: {planner} solved {other.solved} of {other.count}, the portfolio {mine.solved}."
        count, ratio = compared(PORTFOLIO, planner, own)
        if ratio < 1.0 - _TIE:
            less = f"{100.0 * (1.0 - ratio):.2f} % below the portfolio's"
            yield f"{cell}: J of {planner} is {less} in the median of the {count} runs that both solved."


def _cell_section(runs: Sequence[Run], name: str, planners: Sequence[str]) -> str:
    """Picture, figures of blocked and of free pairs apart, and time against energy."""
    cell, own = load_cell(name), of_cell(runs, name)
    blocked, free = [r for r in own if not r.free_ptp], [r for r in own if r.free_ptp]
    picture = cell_picture(cell, np.array(cell.tasks[0].start))
    parts = [f"<h2>{text(cell.name)}</h2>{picture}"]
    for title, part in (
        ("The straight movement is blocked", blocked),
        ("The straight movement is free", free),
    ):
        if part:
            rows = [_row(figures(planner, part)) for planner in planners]
            parts.append(f"<h3>{title}</h3>{table(_HEADS, rows, f'{cell.name}: {title.lower()}')}")
    means = energy_and_time(planners, own)
    drawn = front_chart([Point(planner, *means[planner], "measured") for planner in means], "duration")
    if drawn:
        parts.append(f'<h3>Time against energy</h3><p class="hint">{_FRONT_HINT}</p>{drawn}')
    return f"<section>{''.join(parts)}</section>".replace(
        'id="energy_over_cycle_time"', f'id="energy_{text(re.sub(r"[^a-z0-9]+", "_", cell.name.lower()))}"'
    )


_FRONT_HINT = (
    "Means over the questions that all planners solved which solved any; the line joins those that no other "
    "one beats in both."
)


def _row(found: Figures) -> tuple[str, ...]:
    return (
        text(found.planner),
        f"<b>{found.solved}</b> of {found.count}",
        milliseconds(found.first),
        milliseconds(found.final),
        percent(found.cost_ratio - 1.0),
        percent(found.movement_ratio - 1.0),
        seconds(found.duration),
        joules(found.energy),
        millimetres(found.clearance),
        str(found.lost) if found.lost else DASH,
    )


def milliseconds(value: float) -> str:
    """Seconds as milliseconds."""
    return f"{1e3 * value:,.0f} ms".replace(",", " ") if np.isfinite(value) else DASH


def _curves(runs: Sequence[Run], settings: ArenaSettings) -> Iterator[dict[str, Json]]:
    """Success and cost over time, for all cells together and for each."""
    time, planners = np.linspace(0.0, longest(runs), GRID), settings.planners
    places = [("all cells", list(runs)), *((cell, of_cell(runs, cell)) for cell in settings.cells)]
    kinds: tuple[tuple[str, Callable[..., FloatArray], float], ...] = (
        ("solved", success_over_time, 0.0),
        ("J above the best known, median", cost_over_time, _ABOVE),
    )
    for name, compute, missing in kinds:
        for place, own in places if len(settings.cells) > 1 else places[:1]:
            value = np.nan_to_num(np.minimum(compute(planners, own, time), _ABOVE), nan=missing)
            curves = Curves(f"{name}, {place}", "%", time, value, shown=place == "all cells")
            yield {**packed(curves), "names": list(planners), "ends": [float(time[-1])] * len(planners)}
