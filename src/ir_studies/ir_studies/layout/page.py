"""The page of a layout study: one HTML file with what follows, a map of energy over placement,
reasons.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ir_description import Cell
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.file_roots import ANYWHERE
from ir_planner.checks import Interval
from ir_recorder.report.files import write_output
from ir_recorder.report.number_text import DASH, joules, millimetres, percent, text
from ir_recorder.report.page import PAGE_START
from ir_recorder.report.tables import table
from ir_studies.layout.finals import Final
from ir_studies.layout.freedom import Variable
from ir_studies.layout.placement import Known
from ir_studies.layout.plan_view import Mark, PlanView, colour, estimates, legend, mark, shown_range
from ir_studies.layout.search import GIVEN
from ir_studies.layout.settings import LayoutSettings
from ir_studies.layout.summary import cost_words, ends, of_condition, sentences
from ir_studies.page import page

# width, height and room for numbers
_CHART = 340.0
_HIGH = 190.0
_LEFT = 52.0
_BELOW = 30.0
_MACHINE = "equipment."  # before the name of an owner that is one
_SENTENCE = 300  # characters of a reason
_HEADS = (
    "placement", "for", ">joules per cycle, 90 % interval", ">between seeds",
    ">less than given, 90 % interval", ">movements", ">duration", ">clearance",
)  # fmt: skip


def write_page(
    known: Sequence[Known],
    finals: Sequence[Sequence[Final]],
    settings: LayoutSettings,
    cell: Cell,
    path: Path,
) -> Path:
    """Write the page in place of another page; its absolute path. PathError when it can't be
    written.
    """
    return write_output(
        path, page_html(known, finals, settings, cell).encode(), PAGE_START, ANYWHERE
    )


def page_html(
    known: Sequence[Known], finals: Sequence[Sequence[Final]], settings: LayoutSettings, cell: Cell
) -> str:
    """The page as text. cell: as given."""
    said = "".join(f"<li>{text(one)}</li>" for one in sentences(known, finals, settings))
    parts = {
        "title": f"Layout of {text(cell.name)}",
        "subtitle": text(
            f"{len(known)} placements, {len(settings.variables)} variables; energies are predicted"
        ),
        "verdict": f"<ul>{said}</ul>",
        "best": table(_HEADS, _rows(finals), "The best placements"),
        "map": "".join(_maps(known, finals, settings, cell)),
        "cost": text(cost_words(settings)),
        "legend": legend(*shown_range(known)),
        "variables": "".join(_charts(known, finals, settings)),
        "impossible": _impossible(known),
        "settings": text(json.dumps(asdict(settings))),
    }
    return page("layout", parts)


def _rows(finals: Sequence[Sequence[Final]]) -> Iterator[tuple[str, ...]]:
    given, _ = ends(finals)
    rank = 0
    for own in finals:
        rank += not own[0].is_given
        for one in own:
            name = "as given" if one.is_given else f"best_{rank}.yaml: {one.placement.key}"
            if not one.solved:
                yield text(name), text(one.condition.text), *[DASH] * (len(_HEADS) - 2)
                continue
            less = DASH
            if given is not None and not one.is_given:
                like = of_condition(given, one)
                saved, between = one.saving(like)
                share = percent(saved / like.mean()).lstrip("+")
                less = _with_interval(f"{joules(saved)} ({share})", between)
            yield (
                text(name), text(one.condition.text), _with_interval(joules(one.mean()), one.interval),  # noqa: E501
                joules(one.spread()), less, joules(one.mean("moving_j")),
                f"{one.mean('duration_s'):.2f} s", millimetres(one.mean("clearance_m")),
            )  # fmt: skip


def _with_interval(value: str, within: Interval) -> str:
    """A value with its interval on a line of its own."""
    return f"{value}<br><small>{joules(within.low)} … {joules(within.high)}</small>"


def _maps(
    known: Sequence[Known], finals: Sequence[Sequence[Final]], settings: LayoutSettings, cell: Cell
) -> Iterator[str]:
    """One view from above for everything that moves along the floor."""
    _, best = ends(finals)
    star = settings.placing.cell(cell, best[0].placement.values) if best else None
    limits = shown_range(known)
    costs = dict(zip(map(id, known), estimates(known), strict=True))
    owners = [v.owner for v in settings.variables if v.part in ("x", "y") and v.owner != "tool"]
    drawings: list[tuple[str, list[Mark]]] = []
    for owner in dict.fromkeys(owners):
        at = place_of(owner, cell)
        marks: list[Mark] = []
        for one in sorted(known, key=lambda one: _drawn_last(one, costs[id(one)])):
            shift = [one.placement.values.get(f"{owner}.{axis}", 0.0) for axis in "xy"]
            marks.append((at + shift, *_mark_of(one, costs[id(one)], limits)))
        marks.append((at, "given", "", "as given"))
        if star is not None:
            marks.append((place_of(owner, star), "best", "", "best"))
        drawings.append((owner.removeprefix(_MACHINE), marks))
    for name, marks in drawings:
        view = PlanView(cell, star, np.array([place for place, *_ in marks]))
        title = f"{name}, {view.across:.1f} m from edge to edge"
        yield f"<div><h3>{text(title)}</h3>{view.drawn(f'Where {name} stands', marks)}</div>"


def place_of(owner: str, cell: Cell) -> FloatArray:
    """Where the base or a machine stands (2,) m."""
    pose = cell.base_pose if owner == "base" else cell.machine(owner.removeprefix(_MACHINE)).pose
    return np.array(pose[:2, 3])


def _drawn_last(one: Known, cost: float) -> tuple[int, float]:
    """The best is drawn over the others, and what was planned over what was estimated."""
    return (2 if math.isfinite(one.cost) else 1, -cost) if math.isfinite(cost) else (0, 0.0)


def _mark_of(one: Known, cost: float, limits: tuple[float, float]) -> tuple[str, str, str]:
    """Kind, colour and words of a placement's mark."""
    if one.cost == math.inf:
        return "cross", "", f"{one.placement.key}: {one.reason[0]}"
    kind, words = ("dot", "") if math.isfinite(one.cost) else ("open", "about ")
    return kind, colour(cost, *limits), f"{one.placement.key}: {words}{joules(cost)}"


def _charts(
    known: Sequence[Known], finals: Sequence[Sequence[Final]], settings: LayoutSettings
) -> Iterator[str]:
    low, high = shown_range(known)
    if math.isfinite(low):
        for variable in settings.variables:
            yield _chart(variable, known, low, max(high, low * 1.001))


def _chart(variable: Variable, known: Sequence[Known], low: float, high: float) -> str:
    """Cost over one variable; what is dearer than shown stands at the upper edge."""
    width = max(variable.high - variable.low, 1e-9)
    marks = []
    for one in sorted(known, key=lambda one: _drawn_last(one, one.cost)):
        value = one.placement.values.get(variable.name, 0.0)
        if not math.isfinite(one.cost):
            continue
        x = _LEFT + (_CHART - _LEFT - 10.0) * (value - variable.low) / width
        y = 10.0 + (_HIGH - _BELOW - 10.0) * (1.0 - min((one.cost - low) / (high - low), 1.0))
        given = one.placement.key == GIVEN.key
        words = f"{variable.name} {value:g} {variable.unit}: {joules(one.cost)}"
        marks.append(mark(x, y, "given" if given else "dot", colour(one.cost, low, high), words))
    ends_of = ((_LEFT, "start", variable.low), (_CHART - 10.0, "end", variable.high))
    numbers = [
        f'<text x="{x:g}" y="{_HIGH - 10:g}" text-anchor="{anchor}">{value:g} '
        f"{variable.unit}</text>"
        for x, anchor, value in ends_of
    ]
    numbers += [
        f'<text x="{_LEFT - 6:g}" y="{y:g}" text-anchor="end">{value / 1e3:.1f}</text>'
        for y, value in ((16.0, high), (_HIGH - _BELOW, low))
    ]
    line = f'<path class="grid" d="M{_LEFT:g} 8V{_HIGH - _BELOW + 4:g}H{_CHART - 6:g}"/>'
    return (
        f"<figure><figcaption>{text(variable.name)} (kJ)</figcaption>"
        f'<svg class="over" viewBox="0 0 {_CHART:g} {_HIGH:g}" role="img" '
        'aria-label="Cost over '
        f'{text(variable.name)}">{line}{"".join((*numbers, *marks))}</svg></figure>'
    )


def _impossible(known: Sequence[Known]) -> str:
    """Kinds of reasons with their counts and the commonest sentence of each."""
    by: dict[str, list[str]] = {}
    for one in known:
        if one.cost == math.inf:
            kind, sentence = one.reason
            by.setdefault(kind, []).append(_without_numbers(sentence))
    rows = []
    for kind, said in sorted(by.items(), key=lambda pair: -len(pair[1])):
        for sentence, count in Counter(said).most_common(3):
            rows.append((text(kind), str(len(said)), f"{count} ×", text(sentence)))
    if not rows:
        return '<p class="empty">Nothing was impossible.</p>'
    return table(
        ("reason", ">placements", ">of these", "what it says"), rows, "Impossible placements"
    )


def _without_numbers(sentence: str) -> str:
    """Sentences that differ by numbers alone count as one."""
    return re.sub(r"-?\d+\.\d+|-?\b\d+\b(?! %)", "…", sentence)[:_SENTENCE]
