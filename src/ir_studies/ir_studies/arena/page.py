"""Page of an arena: one HTML file with figures, distributions and pictures of the cells."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from ir_description import Cell, is_path, load_cell
from ir_kernels import Chain
from ir_msgs_py.options import ROBOTS_TIME_VALUE
from ir_planner.search import SEARCHES
from ir_planner.search.with_ompl import needs_ompl
from ir_recorder.analysis.intervals import LEVEL, Mean
from ir_recorder.report.answer import Answer
from ir_recorder.report.files import write_output
from ir_recorder.report.methods import counted
from ir_recorder.report.number_text import DASH, joules, millimetres, percent, seconds, text
from ir_recorder.report.page import PAGE_START, asset
from ir_recorder.report.series import Curves, Json, packed
from ir_recorder.report.shapes import body_mesh, capsule_mesh
from ir_recorder.report.tables import COMPACT, bar, table
from ir_studies.arena.figures import (
    GRID,
    Against,
    ArenaRun,
    Figures,
    against,
    blocked_and_free,
    cost_over_time,
    figures,
    longest,
    of_all,
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
    return _polygons(cell.name, solids)


def _polygons(name: str, solids: list[tuple[str, FloatArray]]) -> str:
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


SCRIPTS = ("charts.js", "axes.js", "export.js", "side_by_side.js")
_AGAINST = ">cost against"
_HEADS = (
    "planner", ">solved", ">first answer", ">best answer", _AGAINST,
    ">movement cost above the least", ">duration", ">energy", ">clearance", ">lost",
)  # fmt: skip
_TIE = 1e-3  # of the cost: less is no difference to anybody
_CHANCE = 1.0 - LEVEL  # a difference that is as likely by chance is not shown
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
    blocked, _ = blocked_and_free(runs)
    shown = of_all(blocked or runs)
    ranking = _ranked(shown, settings)
    winner = settings.planners[0] if ranking is None else ranking.winner
    end = min(longest(shown), settings.seconds)  # what comes after these doesn't count
    head = Head(
        "Arena: planners against each other",
        _subtitle(runs, settings, missing),
        _answer(ranking, runs, settings, missing),
        *_verdict(ranking, runs, settings, missing),
    )
    parts = {
        "time_value": _second(settings.time_value),
        "ranking": _ranking_table(ranking) if ranking is not None else "",
        "verdict": verdict(runs, settings),
        "shown": _shown(runs, shown),
        "above": f"{_ABOVE:g}",
        "winner": text(winner),
        "longest": seconds(longest(runs)),
        "cells": "".join(
            _cell_section(of_cell(runs, cell), cell, titles[cell], settings.planners, winner)
            for cell in settings.cells
            if of_cell(runs, cell)
        ),
        "bindings": text(_bindings(runs, settings.planners)),
        "settings": text(settings_text(settings)),
        "data": json.dumps(
            {
                "end": end,
                "axes": list(_curves(shown, settings.planners, end, _few(ranking), winner)),
            },
            separators=(",", ":"),
        ).replace("<", "\\u003c"),
    }
    return page("arena", head, parts, "\n".join(asset(script) for script in SCRIPTS))


@dataclass(frozen=True)
class _Ranking:
    """The winner, who solved most and of those costs least; the others against it, in the order of
    what they solved and cost. found: by planner.
    """

    winner: str
    others: tuple[Against, ...]
    found: Mapping[str, Figures]
    questions: int

    @property
    def soonest(self) -> Figures:
        """Of those that solved as many as the winner who has the soonest first answer."""
        most = self.found[self.winner].solved
        return min(
            (one for one in self.found.values() if one.solved == most), key=lambda one: one.first
        )


def _ranked(runs: Sequence[ArenaRun], settings: ArenaSettings) -> _Ranking | None:
    """None where no planner solved any run."""
    every = [figures(planner, runs) for planner in settings.planners]
    order = sorted(
        (one for one in every if one.count), key=lambda one: (-one.success, one.cost_ratio)
    )
    if not order or not order[0].solved:
        return None
    winner = order[0].planner
    others = tuple(against(winner, one.planner, runs) for one in order[1:])
    questions = len({run.entry.question for run in runs})
    return _Ranking(winner, others, {one.planner: one for one in order}, questions)


def _differs(other: Against) -> str:
    """How another planner differs from the winner, where that is shown; "" where it isn't."""
    if other.chance < _CHANCE and other.fewer != other.more:
        return "solves fewer" if other.fewer > other.more else "solves more"
    if other.cost.low > 100.0 * _TIE:
        return "costs more"
    if other.cost.high < -100.0 * _TIE:
        return "costs less where both solve"
    return ""


def _ranking_table(ranking: _Ranking) -> str:
    """Every planner: what it solved, its cost and its first answer against the winner's."""
    mine = ranking.found[ranking.winner]
    soonest = ranking.soonest
    rows = [
        (
            f"<b>{_breakable(mine.planner)}</b><small>wins</small>",
            f"<b>{mine.solved}</b> of {mine.count}",
            bar(mine.success, 1.0, "planned"),
            DASH,
            _first(mine, soonest),
        )
    ]
    for other in ranking.others:
        own = ranking.found[other.planner]
        rows.append(
            (
                f"{_breakable(own.planner)}<small>{_differs(other) or _ALIKE}</small>",
                f"<b>{own.solved}</b> of {own.count}",
                bar(own.success, 1.0, ""),
                _with_ends(other.cost),
                _first(own, soonest),
            )
        )
    heads = ("planner", ">solved", "", f"{_AGAINST} {ranking.winner}", ">first answer")
    return table(heads, rows, "Who wins", COMPACT)


_ALIKE = "not shown to differ"


def _first(own: Figures, soonest: Figures) -> str:
    """The first answer of a planner, in bold where none of those that solved most is sooner."""
    shown = milliseconds(own.first)
    return f"<b>{shown}</b>" if own is soonest else shown


def _breakable(name: str) -> str:
    """A planner's name, which a line may break after an underscore only."""
    return text(name).replace("_", "_<wbr>")


def _with_ends(found: Mean) -> str:
    """A difference in percent with its interval."""
    if not math.isfinite(found.value):
        return DASH
    ends = ""
    if math.isfinite(found.low):
        low = percent(found.low / 100.0).removesuffix(" %")
        ends = f"<small>{low} to {percent(found.high / 100.0)}</small>"
    return f"{percent(found.value / 100.0)}{ends}"


def _subtitle(runs: Sequence[ArenaRun], settings: ArenaSettings, missing: int) -> str:
    questions = len({run.entry.question for run in runs})
    made = (
        f"{len(runs)} runs" if not missing else f"so far {len(runs)} of {len(runs) + missing} runs"
    )
    without = len(_without(runs, settings))
    cells = counted(len(settings.cells), "cell")
    if without:
        cells = f"{len(settings.cells) - without} of {cells}"
    asked = ", ".join(
        (
            counted(len(settings.planners), "planner"),
            cells,
            counted(questions, "movement"),
            counted(settings.seeds, "seed"),
        )
    )
    return f"{asked}: {made} of {settings.seconds:g} s of processor"


def _without(runs: Sequence[ArenaRun], settings: ArenaSettings) -> list[str]:
    """Titles of cells without a run."""
    return [title for cell, title in _titles(settings.cells).items() if not of_cell(runs, cell)]


def _shown(runs: Sequence[ArenaRun], shown: Sequence[ArenaRun]) -> str:
    """Which movements are compared, and which are not."""
    movements = len({run.entry.question for run in shown})
    blocked, free = blocked_and_free(runs)
    if not blocked:
        return "The straight line is free in every movement: nothing was searched."
    said = f"Compared over {counted(movements, 'movement')}."
    if free:
        left = len({run.entry.question for run in free})
        said += f" {left} whose straight line is free are left out: there nothing is searched."
    later = len({run.entry.question for run in blocked}) - movements
    if later:
        said += f" {later} more that not every planner was asked yet."
    return said


def _second(time_value: float) -> str:
    """What a second costs [W] in words."""
    return "each robot's own price [W]" if time_value == ROBOTS_TIME_VALUE else f"{time_value:g} W"


def _answer(
    ranking: _Ranking | None, runs: Sequence[ArenaRun], settings: ArenaSettings, missing: int
) -> Answer:
    """Who won, how sure that is, and what it means for the choice of a planner. missing: runs that
    were not made yet.
    """
    if ranking is None:
        return Answer("Nobody wins", "No planner solved any run.")
    best = ranking.found[ranking.winner]
    words = (
        f"{best.planner} solved most, {best.solved} of {best.count} runs, and of those that solved "
        f"as many its trajectories cost least. {counted(len(settings.planners), 'planner')} had "
        f"{settings.seconds:g} s of processor for each of "
        f"{counted(ranking.questions, 'movement')}{_left_out(runs)}."
    )
    return Answer(
        _result(ranking),
        words,
        _sure(ranking, runs, settings, missing),
        _to_do(ranking, runs, settings),
        [
            f"The median movement takes {seconds(best.duration)} and {joules(best.energy)}; 1 % of "
            f"it is {joules(0.01 * best.energy)}."
        ],
    )


def _left_out(runs: Sequence[ArenaRun]) -> str:
    """How many movements count for nobody, as their straight line is free; "" without one."""
    left = len({run.entry.question for run in blocked_and_free(runs)[1]})
    return f"; {left} more have a free straight line and need no search" if left else ""


def _result(ranking: _Ranking) -> str:
    """Whether to keep the default, else whom the first one is shown to beat."""
    worse = sum(_differs(other) != "" for other in ranking.others)
    if worse and ranking.winner == PORTFOLIO:
        return f"Keep the default ({PORTFOLIO})"
    if not ranking.others or worse == len(ranking.others):
        return f"{ranking.winner} wins"
    if worse:
        return f"{ranking.winner} wins against {worse} of {len(ranking.others)}"
    return "Nobody is shown to win"


def _sure(
    ranking: _Ranking, runs: Sequence[ArenaRun], settings: ArenaSettings, missing: int
) -> list[str]:
    """Which others are shown to be worse, and which are not."""
    if not ranking.others:
        return ["There is nobody to compare with."]
    alike = [other.planner for other in ranking.others if not _differs(other)]
    differ = [other.planner for other in ranking.others if _differs(other)]
    named = f": {', '.join(differ)}" if differ else ""
    said = [f"{len(differ)} of the {len(ranking.others)} others are shown to differ{named}."]
    if missing:
        without = _without(runs, settings)
        none = f", none of {', '.join(without)}" if without else ""
        said.insert(0, f"Not finished: {len(runs)} of {len(runs) + missing} runs{none}.")
    if alike:
        said.append(
            f"No difference of {_TIE:.1%} is shown to {', '.join(alike)}.".replace("%", " %")
        )
    if _is_judged(settings) and not behind(runs, settings):
        said.append(f"In no cell is anybody shown to be ahead of the {PORTFOLIO}.")
    return said


def _to_do(ranking: _Ranking, runs: Sequence[ArenaRun], settings: ArenaSettings) -> str:
    if not _is_judged(settings):
        return ""
    if ranking.winner != PORTFOLIO:
        return (
            f"In cells like these {ranking.winner} may be named instead of the default, "
            f"{PORTFOLIO}."
        )
    ahead = len(behind(runs, settings))
    but = f", but see {counted(ahead, 'exception')} below" if ahead else ""
    return f"It is the default: in cells like these no planner need be named{but}."


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


def _is_judged(settings: ArenaSettings) -> bool:
    return PORTFOLIO in settings.planners and len(settings.planners) > 1


def _verdict(
    ranking: _Ranking | None, runs: Sequence[ArenaRun], settings: ArenaSettings, missing: int
) -> tuple[str, bool]:
    """The badge: how many runs were made of all, or, with all of them, whether the default wins."""
    if missing:
        return f"{len(runs)} of {len(runs) + missing} runs", False
    if ranking is None or not _is_judged(settings):
        return "", False
    if ranking.winner == PORTFOLIO:
        return "Nobody is ahead of the default", True
    return f"{ranking.winner} is ahead of the default", False


def verdict(runs: Sequence[ArenaRun], settings: ArenaSettings) -> str:
    """Where somebody solved more than the portfolio or costs less, as a section; "" where nobody
    is to be named.
    """
    if not _is_judged(settings):
        return ""
    items = "".join(f"<li>{text(words)}</li>" for words in behind(runs, settings))
    head = f"Where another one is ahead of the {PORTFOLIO}"
    return f'<section id="verdict"><h2>{head}</h2><ul>{items}</ul></section>' if items else ""


def _against(own: Sequence[ArenaRun], place: str, settings: ArenaSettings) -> Iterator[str]:
    """Who solved more than the portfolio, and all whose cost is lower in one sentence, unless the
    interval of the difference holds none.
    """
    found = {planner: figures(planner, own) for planner in settings.planners}
    mine = found[PORTFOLIO]
    lower = []
    for planner, other in found.items():
        if other.success > mine.success:
            yield (
                f"{place}: {planner} solved {other.solved} of {other.count}, the portfolio "
                f"{mine.solved}."
            )
        held = against(PORTFOLIO, planner, own)
        if held.cost.value < -100.0 * _TIE and not held.cost.high > 0.0:
            lower.append(f"{planner} {_less(held)}")
    if lower:
        yield (
            f"{place}: cost below the portfolio's, in the median of the movements that both "
            f"solved: {', '.join(lower)}."
        )


def _less(held: Against) -> str:
    """By how much a planner costs less, and how sure that is."""
    less = f"{-held.cost.value:.2f} %"
    if not math.isfinite(held.cost.low):
        return f"{less} ({counted(held.both, 'movement')}, too few to be sure)"
    return f"{less} (90 % interval {-held.cost.high:.2f} to {-held.cost.low:.2f} %)"


def _cell_section(
    runs: Sequence[ArenaRun], name: str, title: str, planners: Sequence[str], winner: str
) -> str:
    """Picture, and figures of blocked and of free pairs apart; costs against the winner's, as above
    over all cells.
    """
    cell = load_cell(name)
    blocked, free = blocked_and_free(runs)
    picture = cell_picture(cell, np.array(cell.tasks[0].start))
    heads = [f"{head} {winner}" if head == _AGAINST else head for head in _HEADS]
    parts = []
    for head, part in ((_BLOCKED, blocked), (_FREE, free)):
        if part:
            rows = [
                _planner_cells(figures(planner, part), against(winner, planner, part).cost, winner)
                for planner in planners
            ]
            parts.append(f"<h3>{head}</h3>{table(heads, rows, f'{title}: {head.lower()}')}")
    shown = picture + "".join(parts)
    head = f"<summary><h2>{text(title)}</h2></summary>"
    return f'<details class="part">{head}{shown}</details>'


def _planner_cells(found: Figures, cost: Mean, winner: str) -> tuple[str, ...]:
    """A planner's row of the table."""
    return (
        text(found.planner),
        f"<b>{found.solved}</b> of {found.count}",
        milliseconds(found.first),
        milliseconds(found.final),
        DASH if found.planner == winner else percent(cost.value / 100.0),
        percent(found.movement_ratio - 1.0),
        seconds(found.duration),
        joules(found.energy),
        millimetres(found.clearance),
        str(found.lost) if found.lost else DASH,
    )


def milliseconds(value: float) -> str:
    """Seconds as milliseconds."""
    return f"{1e3 * value:,.0f} ms".replace(",", " ") if np.isfinite(value) else DASH


_FEW = 4  # planners, the first ones, whose curves are named at their ends


def _few(ranking: _Ranking | None) -> list[str]:
    """Planners whose curves matter."""
    if ranking is None:
        return []
    return [ranking.winner, *(other.planner for other in ranking.others)][:_FEW]


def _curves(
    runs: Sequence[ArenaRun], planners: Sequence[str], end: float, few: Sequence[str], winner: str
) -> Iterator[dict[str, Json]]:
    """Success and cost over time until `end` s, of all cells together; few: whose curves stand
    out; winner: whom costs are held against.
    """
    time = np.linspace(0.0, end, GRID)
    solved = success_over_time(planners, runs, time)
    cost = cost_over_time(planners, runs, time, winner)
    kinds = (
        ("solved", solved, 0.0),
        (f"cost against {winner}", np.minimum(cost, _ABOVE), _ABOVE),
    )
    for name, found, missing in kinds:
        value = np.nan_to_num(found, nan=missing)
        yield {
            **packed(Curves(name, "%", time, value, shown=True)),
            "names": list(planners),
            "ends": [float(time[-1])] * len(planners),
            "few": [k for k, planner in enumerate(planners) if planner in few],
            **({"most": _ABOVE} if missing else {}),
        }
