"""One HTML file: today's program and the planner's, for those who pay and for those who change
programs.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from ir_description import Cell
from ir_msgs_py.before_after import BeforeAfter, Side
from ir_msgs_py.file_roots import ANYWHERE, FileRoots
from ir_recorder.report.before_after.figures import (
    assumptions,
    change_table,
    figure_table,
    hop_table,
    tiles,
)
from ir_recorder.report.cell_scene import cell_scene
from ir_recorder.report.costs import Costs
from ir_recorder.report.files import write_output
from ir_recorder.report.front import Point, front_chart
from ir_recorder.report.page import PAGE_START, asset
from ir_recorder.report.side_motion import motion_of, power_curves
from ir_recorder.report.words import text

SCRIPTS = ("charts.js", "axes.js", "renderer.js", "motion.js", "export.js", "before_after.js")


def write_before_after(
    found: BeforeAfter,
    cell: Cell,
    path: str | Path,
    costs: Costs | None = None,
    roots: FileRoots = ANYWHERE,
) -> Path:
    """Writes the page below `roots`; its absolute path. PathError when it can't be written."""
    return write_output(path, before_after_html(found, cell, costs).encode(), PAGE_START, roots)


def before_after_html(found: BeforeAfter, cell: Cell, costs: Costs | None = None) -> str:
    """The page as text; without `costs` with those that are assumed."""
    prices = costs or Costs()
    there = [found.today, *(side for side in found.sides if side.found)]
    data = {
        "end": max(side.report.duration for side in there),
        "cell": cell_scene(cell),
        "sides": [motion_of(side, cell) for side in there],
        "planned": found.towards,
        "axes": [power_curves(there)],
    }
    parts = {
        "title": text(f"{cell.name}: today and planned"),
        "subtitle": text(
            f"{found.name} ({found.kind}) against what the planner makes of the same stops"
        ),
        "problems": _problems(found),
        "tiles": tiles(found, prices),
        "figures": figure_table(found, prices),
        "assumptions": assumptions(found, prices),
        "changes": change_table(found, prices),
        "hops": hop_table(found),
        "front": front_chart([_point(side) for side in there]),
        "choices": "".join(_choice(side, found.towards) for side in there[1:]),
        "style": asset("page.css") + asset("before_after.css"),
        "data": json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        "script": "\n".join(asset(script) for script in SCRIPTS),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], asset("before_after.html"))


def _problems(found: BeforeAfter) -> str:
    items = [
        *found.notes,
        *(f"{side.name}: {side.problem}" for side in found.sides if not side.found),
    ]
    if not items:
        return ""
    listed = "".join(f"<li>{text(item)}</li>" for item in items)
    return f'<div class="problems"><b>Mind</b><ul>{listed}</ul></div>'


def _point(side: Side) -> Point:
    return Point(side.name, side.report.duration, side.report.energy, "predicted")


def _choice(side: Side, towards: str) -> str:
    chosen = " selected" if side.name == towards else ""
    return f'<option value="{text(side.name)}"{chosen}>{text(side.name)}</option>'
