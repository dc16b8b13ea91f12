"""Page of an arena: one HTML file with figures, distributions and pictures of the cells."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from ir_description import Cell, is_path, load_cell
from ir_kernels import Chain
from ir_msgs_py.options import ROBOTS_TIME_VALUE
from ir_planner.search import SEARCHES
from ir_planner.search.with_ompl import needs_ompl
from ir_recorder.report.bars import Piece, Row, bars
from ir_recorder.report.charts import Point, front_chart
from ir_recorder.report.files import write_output
from ir_recorder.report.methods import counted
from ir_recorder.report.number_text import DASH, joules, millimetres, percent, seconds, text
from ir_recorder.report.page import PAGE_START, asset
from ir_recorder.report.paid import Tile, row_of
from ir_recorder.report.series import Curves, Json, packed
from ir_recorder.report.shapes import body_mesh, capsule_mesh
from ir_recorder.report.shell import Answer
from ir_recorder.report.tables import table
from ir_studies.arena.figures import (
    GRID,
    ArenaRun,
    Figures,
    blocked_and_free,
    compared,
    cost_over_time,
    energy_and_time,
    figures,
    longest,
    of_cell,
    success_over_time,
)
from ir_studies.arena.settings import PORTFOLIO, ArenaSettings, settings_text
from ir_studies.page import Head, page
from ir_values.arrays import FloatArray
from ir_values.files import ANYWHERE

# A small picture of a cell: bodies and robot as shaded outlines, seen from a corner above.

WIDTH = 220.0  # of the drawing; its height follows
_AZIMUTH = math.radians(35.0)
_ELEVATION = math.radians(28.0)
_MARGIN = 6.0


def cell_picture(cell: Cell, q: FloatArray) -> str:
    """SVG of the cell with its robot at q (n,); each convex body is the hull of what is seen of
    it.
    """
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    links = chain.link_poses(q[None])[0]
    solids: list[tuple[str, FloatArray]] = []
    for body in cell.bodies():
        mesh = body_mesh(body)
        if mesh is not None:
            solids.append(("base", mesh.points @ body.pose[:3, :3].T + body.pose[:3, 3]))
    loads = [capsule for load in cell.loads("") for capsule in load.capsules]
    for kind, capsules in (("a2", cell.robot.capsules), ("a5", loads)):
        for capsule in capsules:
            pose = links[capsule.link]
            solids.append((kind, capsule_mesh(capsule).points @ pose[:3, :3].T + pose[:3, 3]))
    return _drawn(cell.name, solids)


def _drawn(name: str, solids: list[tuple[str, FloatArray]]) -> str:
    """Solids (V, 3) m from far to near, as polygons."""
    right, up, near = _view()
    flat = [
        (kind, np.stack([points @ right, -(points @ up)], 1), points @ near)
        for kind, points in solids
    ]
    flat.sort(key=lambda one: float(one[2].mean()))
    every = np.concatenate([points for _, points, _ in flat])
    low = every.min(axis=0)
    high = every.max(axis=0)
    scale = (WIDTH - 2 * _MARGIN) / max(float(high[0] - low[0]), 1e-6)
    height = scale * float(high[1] - low[1]) + 2 * _MARGIN
    shapes = []
    for kind, points, _ in flat:
        outline = points[ConvexHull(points).vertices]
        corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in scale * (outline - low) + _MARGIN)
        shapes.append(f'<polygon style="fill:var(--{kind})" points="{corners}"/>')
    return (
        f'<svg class="cell" viewBox="0 0 {WIDTH:g} {height:.0f}" role="img" '
        f'aria-label="{text(name)}">'
        f"{''.join(shapes)}</svg>"
    )


def _view() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit vectors to the right, up, and towards who looks."""
    ca = math.cos(_AZIMUTH)
    sa = math.sin(_AZIMUTH)
    ce = math.cos(_ELEVATION)
    se = math.sin(_ELEVATION)
    near = np.array([ce * ca, -ce * sa, se])
    right = np.array([sa, ca, 0.0])
    return right, np.cross(near, right), near


SCRIPTS = ("charts.js", "axes.js", "export.js", "compare.js")
_HEADS = (
    "planner", ">solved", ">first answer", ">best answer", ">cost above the best", ">movement cost above the least",  # noqa: E501
    ">duration", ">energy", ">clearance", ">lost",
)  # fmt: skip
_NAMED = 3  # planners, of those that are alike
_TIE = 5e-5  # of the cost: less is not shown
# percent: what a curve of costs shows where nothing, or something more expensive, is known
_ABOVE = 25.0
_BLOCKED = "The straight movement is blocked"
_FREE = "The straight movement is free"


def write_page(
    runs: Sequence[ArenaRun], settings: ArenaSettings, path: Path, missing: int = 0
) -> Path:
    """Write the page in place of another page; its absolute path. RecorderError when it can't be
    written.
    """
    return write_output(path, page_html(runs, settings, missing).encode(), PAGE_START, ANYWHERE)


def page_html(runs: Sequence[ArenaRun], settings: ArenaSettings, missing: int = 0) -> str:
    """The page as text. missing: runs that were not made yet."""
    titles = _titles(settings.cells)
    every = [figures(planner, runs) for planner in settings.planners]
    blocked, _ = blocked_and_free(runs)
    shown = blocked or runs
    end = min(longest(shown), settings.seconds)  # what comes after these doesn't count
    head = Head(
        "Arena",
        _subtitle(runs, settings, missing),
        _answer(every, runs, settings),
        *_verdict(runs, settings),
    )
    parts = {
        "time_value": _second(settings.time_value),
        "tiles": _tiles(every),
        "solved": _solved_bars(every),
        "verdict": verdict(runs, settings),
        "shown": "Questions whose straight movement is free are left out: there nothing is "
        "searched."
        if blocked
        else "The straight movement is free in every question: nothing was searched.",
        "above": f"{_ABOVE:g}",
        "longest": seconds(longest(runs)),
        "cells": "".join(
            _cell_section(runs, cell, titles, settings.planners)
            for cell in settings.cells
            if of_cell(runs, cell)
        ),
        "bindings": text(_bindings(runs, settings.planners)),
        "settings": text(settings_text(settings)),
        "data": json.dumps(
            {"end": end, "axes": list(_curves(shown, titles, settings.planners, end))},
            separators=(",", ":"),
        ).replace("<", "\\u003c"),
    }
    return page("arena", head, parts, "\n".join(asset(script) for script in SCRIPTS))


def _subtitle(runs: Sequence[ArenaRun], settings: ArenaSettings, missing: int) -> str:
    questions = len({run.entry.question for run in runs})
    made = (
        f"{len(runs)} runs" if not missing else f"so far {len(runs)} of {len(runs) + missing} runs"
    )
    counts = {"planner": len(settings.planners), "cell": len(settings.cells)}
    counts |= {"question": questions, "seed": settings.seeds}
    asked = ", ".join(f"{count} {word}{'s' if count > 1 else ''}" for word, count in counts.items())
    return f"{asked}: {made} of {settings.seconds:g} s of processor"


def _second(time_value: float) -> str:
    """What a second costs [W] in words."""
    return "each robot's own price [W]" if time_value == ROBOTS_TIME_VALUE else f"{time_value:g} W"


def _answer(found: Sequence[Figures], runs: Sequence[ArenaRun], settings: ArenaSettings) -> Answer:
    """What was asked, who won, and what that means for the choice of a planner."""
    known = [one for one in found if one.solved]
    if not known:
        return Answer("No planner solved any run.", "")
    asked = len({run.entry.question for run in runs})
    best = max(known, key=lambda one: (one.success, -one.cost_ratio))
    above = 100.0 * (best.cost_ratio - 1.0)
    said = (
        f"{counted(len(found), 'planner')} had {settings.seconds:g} s of processor for each of "
        f"{counted(asked, 'movement')} between two places. The winner is {best.planner}: it "
        f"solved {best.solved} of {best.count} runs, and of those that solved most its "
        f"trajectories cost least, in the median {above:.2f} % above the best known."
    )
    if not _judged(settings):
        return Answer(said, "")
    means = f"In cells like these {best.planner} may be named instead of the default, {PORTFOLIO}."
    if best.planner == PORTFOLIO:
        means = "It is the default: in cells like these no planner need be named."
    return Answer(f"{said} {means}", "")


def _bindings(runs: Sequence[ArenaRun], planners: Sequence[str]) -> str:
    """What counts for planners of OMPL and what is not alike for them, where there are any."""
    names = [name for name in planners if name in SEARCHES and needs_ompl(SEARCHES[name])]
    if not names:
        return ""
    own = [run for run in runs if run.entry.planner in names]
    paid = sum("start_s" not in run.row for run in own)
    starts = (
        "Loading OMPL counts for nobody, nor does starting a process for each "
        f"request{_least(own)}. "
    )
    if paid:
        starts += f"In {paid} of these runs, of an earlier version, starting them counted. "
    return (
        f"{starts}Not alike: OMPL's planners ({', '.join(names)}) ask for each check on its own, "
        "through Python; the project's searches ask for many in one call, so they make more of "
        "them in the same seconds. Each request starts anew: a roadmap (prm) is not kept for "
        "the next one, and aorrtc, which goes on improving its path, answers when its checks or "
        "its time are spent, not with its first path."
    )


def _least(runs: Sequence[ArenaRun]) -> str:
    known = [run.number("start_s") for run in runs if run.number("start_s") > 0.0]
    return f" ({milliseconds(float(np.median(known)))} each)" if known else ""


def _titles(cells: Sequence[str]) -> dict[str, str]:
    """What the page calls the cells: files by their names, by their paths where two have the
    same.
    """
    short = {cell: Path(cell).name if is_path(cell) else cell for cell in cells}
    names = list(short.values())
    return {cell: name if names.count(name) == 1 else cell for cell, name in short.items()}


def behind(runs: Sequence[ArenaRun], settings: ArenaSettings) -> list[str]:
    """Where somebody solved more than the portfolio, or cost less, in sentences."""
    said: list[str] = []
    for cell, title in _titles(settings.cells).items():
        blocked, free = blocked_and_free(of_cell(runs, cell))
        said += _against(blocked, title, settings)
        said += _against(free, f"{title}, straight movement free", settings)
    return said


def _judged(settings: ArenaSettings) -> bool:
    return PORTFOLIO in settings.planners and len(settings.planners) > 1


def _verdict(runs: Sequence[ArenaRun], settings: ArenaSettings) -> tuple[str, bool]:
    if not _judged(settings):
        return "", False
    if behind(runs, settings):
        return "The portfolio is not ahead everywhere", False
    return "Nobody is ahead of the portfolio", True


def verdict(runs: Sequence[ArenaRun], settings: ArenaSettings) -> str:
    """Whether nobody solved more and cost less than the portfolio in any cell, or where not."""
    if not _judged(settings):
        return ""
    whole = all(of_cell(runs, cell) for cell in settings.cells)
    place = "In no cell" if whole else "In no cell that has runs"
    held = (
        f"{place} did anybody solve more than the portfolio, or have a lower median cost where "
        "both solved."
    )
    items = "".join(f"<li>{text(words)}</li>" for words in behind(runs, settings) or [held])
    return (
        f'<section id="verdict"><h2>The portfolio against the others</h2><ul>{items}</ul></section>'
    )


def _solved_bars(found: Sequence[Figures]) -> str:
    """Who solved how many runs, most first, with the time and cost of its answers."""
    rows = [
        Row(
            one.planner,
            (Piece("planned" if one.planner == PORTFOLIO else "today", "solved", one.success),),
            f"{one.solved} of {one.count}",
            (
                f"first answer {milliseconds(one.first)}",
                f"cost {percent(one.cost_ratio - 1.0)} above the best",
            ),
        )
        for one in sorted(found, key=lambda one: (-one.solved, one.cost_ratio))
        if one.count
    ]
    return bars(rows, "runs that were solved") if rows else ""


def _tiles(found: Sequence[Figures]) -> str:
    """The planner that solved most, the soonest and the cheapest of those that solved as many."""
    known = [one for one in found if one.solved]
    if not known:
        return ""
    most = max(one.success for one in known)
    best = [one for one in known if one.success == most]
    soonest = min(best, key=lambda one: one.first)
    cheapest = min(best, key=lambda one: one.cost_ratio)
    names = ", ".join(one.planner for one in best[:_NAMED])
    more = f" and {len(best) - _NAMED} more" if len(best) > _NAMED else ""
    among = "of those that solved most"
    tiles = (
        Tile("most runs solved", f"{best[0].solved} of {best[0].count}", (f"{names}{more}",)),
        Tile("soonest first answer", milliseconds(soonest.first), (soonest.planner, among)),
        Tile(
            "least cost above the best",
            percent(cheapest.cost_ratio - 1.0),
            (cheapest.planner, among),
        ),
        Tile("least clearance", millimetres(min(one.clearance for one in known)), ("of all runs",)),
    )
    return row_of(tiles)


def _against(own: Sequence[ArenaRun], place: str, settings: ArenaSettings) -> Iterator[str]:
    """Who solved more than the portfolio, and all whose cost is lower in one sentence."""
    found = {planner: figures(planner, own) for planner in settings.planners}
    mine = found[PORTFOLIO]
    lower = []
    for planner, other in found.items():
        if other.success > mine.success:
            yield (
                f"{place}: {planner} solved {other.solved} of {other.count}, the portfolio "
                f"{mine.solved}."
            )
        against = compared(PORTFOLIO, planner, own, _TIE)
        if against.ratio < 1.0 - _TIE:
            less = f"{100.0 * (1.0 - against.ratio):.2f} %"
            lower.append(f"{planner} {less} (lower in {against.lower} of {against.both})")
    if lower:
        yield (
            f"{place}: cost below the portfolio's, in the median of the runs that both solved: "
            f"{', '.join(lower)}."
        )


def _cell_section(
    runs: Sequence[ArenaRun], name: str, titles: Mapping[str, str], planners: Sequence[str]
) -> str:
    """Picture, figures of blocked and of free pairs apart, and time against energy."""
    cell = load_cell(name)
    title = titles[name]
    blocked, free = blocked_and_free(of_cell(runs, name))
    picture = cell_picture(cell, np.array(cell.tasks[0].start))
    parts = []
    for head, part in ((_BLOCKED, blocked), (_FREE, free)):
        if part:
            rows = [_row(figures(planner, part)) for planner in planners]
            parts.append(f"<h3>{head}</h3>{table(_HEADS, rows, f'{title}: {head.lower()}')}")
    means = energy_and_time(planners, blocked or free)
    drawn = front_chart(
        [Point(planner, *means[planner], "measured") for planner in means], "duration"
    )
    if drawn:
        drawn = f'<div><h3>Time against energy</h3><p class="hint">{_FRONT_HINT}</p>{drawn}</div>'
    parts.insert(0, f'<div class="seen">{picture}{drawn}</div>')
    key = f"{list(titles).index(name) + 1}_{re.sub(r'[^a-z0-9]+', '_', title.lower())}"
    shown = "".join(parts).replace('id="energy_over_cycle_time"', f'id="energy_{key}"')
    head = f"<summary><h2>{text(title)}</h2></summary>"
    return f'<details class="part paper">{head}{shown}</details>'


_FRONT_HINT = (
    "Means over the questions (blocked ones where there are any) that all planners solved which "
    "solved any; the line joins those that no other one beats in both."
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


def _curves(
    runs: Sequence[ArenaRun], titles: Mapping[str, str], planners: Sequence[str], end: float
) -> Iterator[dict[str, Json]]:
    """Success and cost over time until `end` s, for all cells together and for each."""
    time = np.linspace(0.0, end, GRID)
    places = [
        ("all cells", list(runs)),
        *((title, of_cell(runs, cell)) for cell, title in titles.items()),
    ]
    kinds: tuple[tuple[str, Callable[..., FloatArray], float, float], ...] = (
        ("solved", success_over_time, 100.0, 0.0),
        ("cost above the best known, median", cost_over_time, _ABOVE, _ABOVE),
    )
    for name, compute, most, missing in kinds:
        for place, own in places if len(titles) > 1 else places[:1]:
            value = np.nan_to_num(np.minimum(compute(planners, own, time), most), nan=missing)
            curves = Curves(f"{name}, {place}", "%", time, value, shown=place == "all cells")
            yield {
                **packed(curves),
                "names": list(planners),
                "ends": [float(time[-1])] * len(planners),
            }
