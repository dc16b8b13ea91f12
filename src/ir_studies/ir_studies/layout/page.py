"""Page and files of a layout study: map of energy over placement, reasons, best cell files."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ir_description import Cell, cell_to_yaml
from ir_planner.checks import JouleInterval
from ir_recorder.analysis.production import Amount
from ir_recorder.report.answer import Answer
from ir_recorder.report.bars import Piece, Row, bars, tick_step
from ir_recorder.report.cycle_costs import cycles_of_year, payback
from ir_recorder.report.files import write_output
from ir_recorder.report.money_text import yearly_money, yearly_span
from ir_recorder.report.number_text import (
    DASH,
    kilowatt_hours,
    millimetres,
    percent,
    seconds,
    span_of,
    text,
)
from ir_recorder.report.page import PAGE_START
from ir_recorder.report.paid import OF_DATA, Tile, between_of, counted_at, row_of
from ir_recorder.report.prices import Costs, assumed_section, counted_with
from ir_recorder.report.shapes import body_mesh, capsule_mesh
from ir_recorder.report.shell import source_badge
from ir_recorder.report.step_table import write_columns
from ir_recorder.report.tables import table
from ir_studies.layout.placement import Known, Variable
from ir_studies.layout.search import GIVEN
from ir_studies.layout.settings import LayoutSettings, PlacementCondition
from ir_studies.layout.summary import (
    Final,
    cost_words,
    ends,
    given_reason,
    of_condition,
    sentences,
)
from ir_studies.page import Head, page, settings_table
from ir_values.arrays import FloatArray
from ir_values.files import ANYWHERE

# The cell from above, with a dot at every place, coloured by its cost.

WIDTH = 520.0  # of a drawing; its height follows
_MARGIN = 12.0
_TALLEST = 1.5  # height of a drawing in widths
_AROUND = 0.6  # of the extent of all places that is shown around them
_LEAST_M = 0.3  # m, at least
Mark: TypeAlias = "tuple[FloatArray, str, str, str]"
"""A place (2,) m, its kind, its colour, its words."""
Move: TypeAlias = "tuple[FloatArray, FloatArray, str]"
"""From and to a place (2,) m, and words."""
_CLOSE_M = 0.2  # m around a cell that is drawn whole
_COLOURS = ("#1a7f5a", "#5aa02c", "#b5a900", "#e08a00", "#d1495b")  # from least cost to most


def colour(cost: float, low: float, high: float) -> str:
    """Of a cost between the least and the most that are shown; "" where it isn't known."""
    if not math.isfinite(cost):
        return ""
    share = (cost - low) / (high - low) if high > low else 0.0
    return _COLOURS[int(np.clip(share * len(_COLOURS), 0, len(_COLOURS) - 1))]


def estimates(known: Sequence[Known]) -> list[float]:
    """Costs of placements; of those that were looked at only, what coarse movements cost, with the
    median of what plans cost above them. Inf where a placement is impossible, NaN where nothing was
    planned.
    """
    above = [one.cost - one.coarse for one in known if math.isfinite(one.cost)]
    more = float(np.median(above)) if above else math.nan
    return [one.coarse + more if math.isnan(one.cost) else one.cost for one in known]


def shown_range(known: Sequence[Known]) -> tuple[float, float]:
    """Least cost, and the one that nine of ten placements stay below; NaN where none was
    planned.
    """
    costs = [cost for cost in estimates(known) if math.isfinite(cost)]
    return (min(costs), float(np.quantile(costs, 0.9))) if costs else (math.nan, math.nan)


_MARKS = (
    ("open", "looked at only: estimated"),
    ("cross", "impossible"),
    ("given", "as given"),
    ("best", "placement 1, the best"),
)
"""Marks whose kind says what they mean, and what."""


def _key(kind: str) -> str:
    """The mark as the drawings have it, beside its words."""
    drawn = mark(0.0, 0.0, kind, "var(--soft)", "")
    return f'<svg class="cost key" viewBox="-9 -9 18 18" aria-hidden="true">{drawn}</svg>'


def legend(low: float, high: float, kinds: Container[str]) -> str:
    """What the colours mean, and the marks of these kinds."""
    steps = np.linspace(low, high, len(_COLOURS) + 1)
    keys = (
        f'<span><svg class="cost key" viewBox="-7.5 -7.5 15 15">'
        f'<circle r="{_radius(one):.1f}" style="fill:{one}"/></svg>'
        f"{text(kilowatt_hours(float(at)))}</span>"
        for one, at in zip(_COLOURS, steps, strict=False)
        if math.isfinite(low)
    )
    rest = "".join(f"<span>{_key(kind)}{words}</span>" for kind, words in _MARKS if kind in kinds)
    return f'<p class="key-row"><span>cost from</span>{"".join(keys)}{rest}</p>'


class PlanView:
    """Draws places (2,) m of the world; given and best: the cell as it is and as it should be, as
    far as it lies around places (N, 2), which all are in sight; size: m along x and y at least.
    across: m from edge to edge.
    """

    def __init__(
        self,
        given: Cell,
        best: Cell | None,
        places: FloatArray,
        size: FloatArray | None = None,
        *,
        close: bool = False,
    ) -> None:
        was = list(outlines(given))
        self._outlines = [("was", one) for one in was]
        if best is not None:
            self._outlines += [("best", one) for one in outlines(best) if _is_new(one, was)]
        extent = float(np.ptp(places, axis=0).max())
        around = _CLOSE_M if close else max(_AROUND * extent, _LEAST_M)
        low = places.min(axis=0) - around
        high = places.max(axis=0) + around
        for _, points in self._outlines:  # what stands at these places is seen as a whole
            inside = (points >= low) & (points <= high)
            if inside.all(axis=1).mean() > _MOSTLY:
                low = np.minimum(low, points.min(axis=0))
                high = np.maximum(high, points.max(axis=0))
        wanted = np.zeros(2) if size is None else size
        more = np.maximum(wanted - (high - low), 0.0)
        self._low = low - 0.5 * more
        self.size = high - low + more
        self.across = float(self.size[0])
        up = float(self.size[1])
        self._scale = (WIDTH - 2 * _MARGIN) / max(self.across, up / _TALLEST)
        self._height = self._scale * up + 2 * _MARGIN

    def drawn(
        self,
        name: str,
        marks: Sequence[Mark],
        moves: Sequence[Move] = (),
        names: Mapping[str, FloatArray] = MappingProxyType({}),
    ) -> str:
        """SVG with marks: place (2,), kind (dot, open, cross, given, best), colour, words; moves:
        arrows between places, with their words; names: of what stands at a place (2,).
        """
        shapes = []
        for kind, points in self._outlines:
            corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in self._at(points))
            shapes.append(f'<polygon class="{kind}" points="{corners}"/>')
        for place, kind, fill, words in marks:
            x, y = self._at(place[None])[0]
            shapes.append(mark(x, y, kind, fill, words))
        boxes = []
        for words, place in names.items():
            x, y = self._at(place[None])[0]
            boxes.append(box_of(words, x - 0.5 * _LETTER * len(words), y + 4.0))
            shapes.append(f'<text class="stands" x="{x:.1f}" y="{y + 4:.1f}">{text(words)}</text>')

        # words of arrows keep off outlines, names and other arrows
        drawn_outlines = [self._at(points) for _, points in self._outlines]
        arrows = [self._at(np.stack([start, end])) for start, end, _ in moves]
        for start, end in arrows:
            shapes.append(arrow(start, end))
        boxes += [(*line.min(axis=0), *line.max(axis=0)) for line in arrows]
        for line, (_, _, words) in zip(arrows, moves, strict=True):
            x, y = place_of_words(words, list(line), drawn_outlines, boxes, self._height)
            boxes.append(box_of(words, x, y))
            shapes.append(f'<text class="move" x="{x:.1f}" y="{y:.1f}">{text(words)}</text>')
        shapes.append(self._measure())
        plan = "plan whole" if moves else "plan"
        return (
            f'<svg class="{plan}" viewBox="0 0 {WIDTH:g} {self._height:.0f}" role="img" '
            f'aria-label="{text(name)}">{"".join(shapes)}</svg>'
        )

    def _measure(self) -> str:
        """A bar of a round length, and the directions of both axes, in the lower corners."""
        length = tick_step(self.across)
        y = self._height - 10.0
        x = WIDTH - 46.0
        words = f"{length:g} m" if length >= 1.0 else f"{100.0 * length:g} cm"
        return (
            f'<path class="measure" d="M10 {y - 4:.1f}v4h{length * self._scale:.1f}v-4"/>'
            f'<text class="measure" x="{16 + length * self._scale:.1f}" y="{y:.1f}">{words}</text>'
            f'<path class="measure" d="M{x:g} {y - 26:.1f}v26h26"/>'
            f'<text class="measure" x="{x + 29:g}" y="{y + 3:.1f}">x</text>'
            f'<text class="measure" x="{x - 4:g}" y="{y - 30:.1f}">y</text>'
        )

    def _at(self, points: FloatArray) -> FloatArray:
        flat = (points - self._low) * self._scale + _MARGIN
        return np.stack([flat[:, 0], self._height - flat[:, 1]], axis=1)


def _is_new(outline: FloatArray, others: Sequence[FloatArray]) -> bool:
    """Whether an outline (V, 2) is none of the others, but for a tenth of a millimetre."""
    alike = (one for one in others if one.shape == outline.shape)
    return not any(np.allclose(one, outline, atol=1e-4) for one in alike)


def arrow(start: FloatArray, end: FloatArray) -> str:
    """An arrow of the drawing between places (2,)."""
    way = end - start
    length = float(np.hypot(*way))
    x, y = way / length if length > 0.0 else np.array([0.0, 1.0])
    left, right = (end - 9.0 * np.array([x, y]) + side * np.array([-y, x]) for side in (4.0, -4.0))
    head = " ".join(f"{a:.1f},{b:.1f}" for a, b in (end, left, right))
    return (
        f'<path class="move" d="M{start[0]:.1f} {start[1]:.1f}L{end[0]:.1f} {end[1]:.1f}"/>'
        f'<polygon class="head" points="{head}"/>'
    )


# Words beside an arrow stand where they cover least of what is drawn.

_LETTER = 12.2  # px of a letter of such words in bold, at most
_TALL = 18.0  # px of their line
_ASIDE = (12.0, 30.0, 54.0)  # px from an end of the arrow to the words
_WAYS = 16  # directions that are tried
Box: TypeAlias = "tuple[float, float, float, float]"
"""Left, top, right and bottom of what is drawn."""


def box_of(words: str, x: float, y: float) -> Box:
    """Where words stand whose line begins at x, y."""
    return x, y - 0.8 * _TALL, x + _LETTER * len(words), y + 0.2 * _TALL


def covered(box: Box, solids: Sequence[FloatArray], boxes: Sequence[Box]) -> float:
    """The share of a box that convex solids (V, 2) or other boxes lie in."""
    left, top, right, bottom = box
    x, y = np.meshgrid(np.linspace(left, right, 17), np.linspace(top, bottom, 7))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    under = np.zeros(len(points), dtype=bool)
    for corners in solids:
        side = np.roll(corners, -1, axis=0) - corners
        away = points[:, None] - corners
        turn = side[:, 0] * away[..., 1] - side[:, 1] * away[..., 0]
        under |= (turn >= 0.0).all(axis=1) | (turn <= 0.0).all(axis=1)
    for low_x, low_y, high_x, high_y in boxes:
        under |= (
            (x.ravel() > low_x) & (x.ravel() < high_x) & (y.ravel() > low_y) & (y.ravel() < high_y)
        )
    return float(under.mean())


def place_of_words(
    words: str,
    tips: Sequence[FloatArray],
    solids: Sequence[FloatArray],
    boxes: Sequence[Box],
    height: float,
) -> tuple[float, float]:
    """Where the line of words beside an arrow with these tips (2,) begins, within the drawing: of
    places around its tip, then its tail, the first of those that cover least.
    """
    wide = _LETTER * len(words)
    turns = [2.0 * math.pi * k / _WAYS for k in range(_WAYS)]
    found: list[tuple[float, float, float]] = []
    for aside in _ASIDE:
        for end in reversed(tips):
            for turn in turns:
                x = end[0] + math.cos(turn) * aside + 0.5 * wide * (math.cos(turn) - 1.0)
                y = end[1] + math.sin(turn) * (aside + 0.3 * _TALL) + 0.3 * _TALL
                x = min(max(x, _MARGIN), WIDTH - _MARGIN - wide)
                y = min(max(y, _MARGIN + _TALL), height - 3.0 * _MARGIN)
                found.append((covered(box_of(words, x, y), solids, boxes), x, y))
    _, x, y = min(found, key=lambda each: each[0])
    return x, y


def mark(x: float, y: float, kind: str, fill: str, words: str) -> str:
    """A mark at a place of the drawing, with words that a pointer shows."""
    title = f"<title>{text(words)}</title>"
    if kind == "cross":
        return f'<path class="cross" d="M{x - 2:.1f} {y - 2:.1f}l4 4m0 -4l-4 4">{title}</path>'
    if kind == "given":
        return f'<path class="given" d="M{x:.1f} {y - 7:.1f}l7 7l-7 7l-7 -7z">{title}</path>'
    if kind == "best":
        return f'<text class="star" x="{x:.1f}" y="{y + 6:.1f}">★{title}</text>'
    style = f'style="{"fill" if kind == "dot" else "stroke"}:{fill}"'
    size = f'r="{_radius(fill):.1f}"'
    return f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" {size} {style}>{title}</circle>'


def _radius(fill: str) -> float:
    """Of a mark: what costs less is larger, so that its colour is not all that says it."""
    least = len(_COLOURS) - 1
    return 3.4 + (0.9 * (least - _COLOURS.index(fill)) if fill in _COLOURS else 0.0)


def outlines(cell: Cell) -> Iterator[FloatArray]:
    """Outlines (V, 2) of machines' bodies and of the robot's base from above."""
    base = [capsule for capsule in cell.robot.capsules if capsule.link == 0]
    solids = [
        (body_mesh(body), body.pose)
        for machine in cell.equipment
        for body in machine.world_bodies()
    ]
    solids += [(capsule_mesh(capsule), cell.base_pose) for capsule in base]
    for mesh, pose in solids:
        if mesh is None:
            continue
        flat = (mesh.points @ pose[:3, :3].T + pose[:3, 3])[:, :2]
        try:
            yield flat[ConvexHull(flat).vertices]
        except QhullError:  # a body without extent from above
            continue


# width, height and room for numbers
_CHART = 340.0
_HIGH = 190.0
_LEFT = 52.0
_BELOW = 30.0
_MOSTLY = 0.5  # of the corners of an outline
_MACHINE = "equipment."  # before the name of an owner that is one
_SENTENCE = 300  # characters of a reason
_HEADS = (
    "placement", "for", ">saved a year", ">saved a cycle", ">energy of a cycle", ">movements",
    ">duration", ">clearance", ">between seeds",
)  # fmt: skip


_ZERO = "the planned program of the layout as given"
_APART = (
    "A year has as many cycles as on the page of its plan; what a plan saves against the common "
    "program (the same stations by PTP at 100 %) comes on top."
)
"""What a layout is held against, and what its money leaves out that a plan's page has."""


def write_page(
    known: Sequence[Known],
    finals: Sequence[Sequence[Final]],
    settings: LayoutSettings,
    cell: Cell,
    path: Path,
) -> Path:
    """Write the page in place of another page; its absolute path. RecorderError when it can't be
    written.
    """
    return write_output(
        path, page_html(known, finals, settings, cell).encode(), PAGE_START, ANYWHERE
    )


def page_html(
    known: Sequence[Known], finals: Sequence[Sequence[Final]], settings: LayoutSettings, cell: Cell
) -> str:
    """The page as text. cell: as given. Money is that of the assumed prices and shifts."""
    costs = Costs()
    said = "".join(
        f"<li>{text(_briefly(one, finals))}</li>" for one in sentences(known, finals, settings)
    )
    head = Head(
        f"Layout of {cell.name}",
        f"{len(known)} placements, {len(settings.variables)} variables; held against {_ZERO}",
        _answer(known, finals, settings, costs),
        *_verdict(finals, costs),
        source_badge("Predicted", "open", "nothing was driven"),
    )
    parts = {
        "tiles": _tiles(known, finals),
        "bars": _bars(finals, costs),
        "places": _places(finals),
        "assumed": assumed_section(costs),
        "searched": f"<ul>{said}</ul>",
        "best": table(_HEADS, _rows(finals, costs), "The best placements"),
        "map": "".join(_maps(known, finals, settings, cell)),
        "cost": text(cost_words(settings)),
        "beside": _beside(finals, settings),
        "moved": _moved_plan(finals, settings, cell),
        "legend": legend(*shown_range(known), _kinds(known, finals)),
        "variables": "".join(_charts(known, finals, settings)),
        "impossible": _impossible(known),
        "settings": settings_table(asdict(settings)),
    }
    return page("layout", head, parts)


def _answer(
    known: Sequence[Known],
    finals: Sequence[Sequence[Final]],
    settings: LayoutSettings,
    costs: Costs,
) -> Answer | None:
    """Whether moving anything pays, in money of a year, how sure that is, and what to do."""
    given, best = ends(finals)
    if best is None:
        return None
    if given is None:
        do = "Use one of the others: best_1.yaml costs least."
        return Answer("As given it is impossible", given_reason(known), "", do)
    one = best[0]
    like = of_condition(given, one)
    year = _year(one, like, costs)
    share = percent(year.energy.value / like.mean()).lstrip("+")
    moving = 1.0 - one.mean("moving_j") / like.mean("moving_j")
    moved = f"{percent(abs(moving)).lstrip('+')} {'less' if moving >= 0.0 else 'more'}"
    words = (
        f"by the best placement, held against {_ZERO}: {kilowatt_hours(year.energy.value)} of "
        f"{kilowatt_hours(like.mean())} at the mains a cycle, pauses included ({share}); the "
        f"movements alone take {moved}."
    )
    between = between_of(year.money, costs)
    seeds = _between_seeds(one)
    sure = [
        f"Predicted, not driven; {OF_DATA}. {_APART}",
        f"{seeds[0].upper()}{seeds[1:]}.",
        _at_limits(one, settings).strip(),
    ]
    sure = [each for each in sure if each]
    rests_on = counted_at(costs)
    given_year = costs.money(like.mean() * costs.cycles_per_year(like.pace))
    bills = [
        (name, f"{yearly_money(each, costs.currency)} a year in shifts")
        for name, each in (
            ("as given", given_year),
            ("placement 1", given_year - year.money.value),
        )
    ]
    if year.money.value <= 0.0 or year.money.low <= 0.0:
        result = "No placement is shown to save"
        do = "Leave everything where it stands."
        return Answer(result, "", sure, do, between=between, counted=rests_on)
    price = yearly_money(year.money.value, costs.currency)
    if year.money.value < costs.engineer_hour:
        hour = f"{costs.engineer_hour:g} {costs.currency}"
        do = (
            f"Leave everything where it stands: a year saves less than an hour of an engineer "
            f"costs ({hour})."
        )
        result = f"Not worth moving: {price} a year"
        return Answer(result, words, sure, do, between=between, counted=rests_on, bills=bills)
    result = f"{price} less a year"
    do = (
        f"Move: that {payback(year.money, costs)}. Plan best_1.yaml, and look at cables, ways of "
        "people and how parts come, which no study knows."
    )
    return Answer(result, words, sure, do, between=between, counted=rests_on, bills=bills)


def _verdict(finals: Sequence[Sequence[Final]], costs: Costs) -> tuple[str, bool]:
    """The badge: whether to move anything."""
    given, best = ends(finals)
    if given is None or best is None:
        return "Predicted, not driven", False
    year = _year(best[0], of_condition(given, best[0]), costs)
    if year.money.low <= 0.0 or year.money.value < costs.engineer_hour:
        return "Leave as it stands", False
    return "Moving pays, predicted", True


def _between_seeds(one: Final) -> str:
    """How far the seeds of a plan lie apart."""
    seeds = len(one.rows)
    if seeds == 1:
        return "planned with one seed"
    apart = f"{kilowatt_hours(one.spread())} a cycle"
    return f"{seeds} searches from different seeds (random numbers) lie {apart} apart"


_EDGE = 0.03  # of its range: a variable that near to an end stands at the edge of what was searched


def _at_limits(one: Final, settings: LayoutSettings) -> str:
    """Which variables of a placement stand at the edge of their range; "" where none does."""
    found = []
    for variable in settings.variables:
        value = one.placement.values.get(variable.name, 0.0)
        near = _EDGE * (variable.high - variable.low)
        inside = variable.low + near < value < variable.high - near
        if not inside and value != 0.0:
            owner = variable.owner.removeprefix(_MACHINE)
            found.append(f"{owner} {variable.part.removesuffix('_deg')}")
    if not found:
        return ""
    return f"The search ended at its edge ({', '.join(found)}): wider ranges may give more. "


@dataclass(frozen=True)
class _Year:
    """What a placement saves of the given one: joules of a cycle, and money of a year of as many
    cycles as its common program makes.
    """

    energy: Amount
    money: Amount


def _year(one: Final, like: Final, costs: Costs) -> _Year:
    less, within = one.saving(like)
    energy = Amount(less, within.low, within.high)
    cycles = costs.cycles_per_year(like.pace)
    return _Year(energy, energy.times(cycles).of(costs.money))


def _beside(finals: Sequence[Sequence[Final]], settings: LayoutSettings) -> str:
    """Why what placements are compared by is less than the energy of a cycle."""
    given, _ = ends(finals)
    if given is None or all(settings.cycle_times):
        return ""
    cycle = kilowatt_hours(given[0].mean())
    cost_of = kilowatt_hours(given[0].mean("cost_j"))
    return (
        '<p class="hint">That is of the movements alone, without pauses and without what the '
        f"controller takes: of {text(cost_of)} as given. The {text(cycle)} of a cycle as given "
        "are all energy at the mains, pauses included.</p>"
    )


def _bars(finals: Sequence[Sequence[Final]], costs: Costs) -> str:
    """What each of the best saves of the given one in a year, with its interval; "" where there is
    nothing to compare.
    """
    given, _ = ends(finals)
    if given is None:
        return ""
    rows = []
    for rank, own in enumerate((own for own in finals if not own[0].is_given), start=1):
        for one in own:
            if not one.solved:
                continue
            year = _year(one, of_condition(given, one), costs)
            price = yearly_money(year.money.value, costs.currency)
            between = yearly_span(year.money.low, year.money.high, costs.currency)
            name = f"placement {rank}"
            notes = (f"{between} {costs.currency}; {kilowatt_hours(year.energy.value)} a cycle",)
            style = "planned" if year.money.value >= 0.0 else "today"
            rows.append(
                Row(
                    name if len(own) == 1 else f"{name}, {one.condition.text}",
                    (Piece(style, name, year.money.value),),
                    price,
                    notes,
                    whisker=(year.money.low, year.money.high),
                )
            )
    if not rows:
        return ""
    like = given[0]
    pace = like.pace
    cost = costs.money(like.mean() * costs.cycles_per_year(pace))
    hint = (
        f"Zero is {_ZERO}: {kilowatt_hours(like.mean())} a cycle, "
        f"{yearly_money(cost, costs.currency)} a year in shifts of {cycles_of_year(pace, costs)}, "
        "which all placements make. Right of it a placement saves. Whisker: 90 % interval."
    )
    drawn = bars(rows, "saved a year")
    return f'{drawn}<p class="hint">{text(hint)} {counted_with(costs)}</p>'


def _tiles(known: Sequence[Known], finals: Sequence[Sequence[Final]]) -> str:
    """A cycle of the best beside that of the given placement, under the first condition."""
    given, best = ends(finals)
    impossible = sum(one.cost == math.inf for one in known)
    planned = sum(math.isfinite(one.cost) for one in known)
    rest = len(known) - planned - impossible
    looked = Tile(
        "placements planned",
        f"{planned} of {len(known)}",
        (f"{impossible} impossible", f"{rest} only estimated" if rest else ""),
    )
    if given is None or best is None:
        return row_of([looked])
    one = best[0]
    like = of_condition(given, one)
    within = one.interval
    several = len(best) > 1
    return row_of(
        [
            Tile(
                "energy of a cycle at the mains, pauses included",
                kilowatt_hours(one.mean()),
                (
                    f"best placement: {_against(like.mean() - one.mean(), kilowatt_hours)}",
                    f"90 % interval {span_of(within.low, within.high, kilowatt_hours)}",
                    one.condition.text if several else "",
                ),
            ),
            Tile(
                "its movements alone, at the mains",
                kilowatt_hours(one.mean("moving_j")),
                (_against(like.mean("moving_j") - one.mean("moving_j"), kilowatt_hours),),
            ),
            Tile(
                "cycle time",
                seconds(one.mean("duration_s")),
                (_against(like.mean("duration_s") - one.mean("duration_s"), seconds),),
            ),
            looked,
        ]
    )


def _against(less: float, show: Callable[[float], str]) -> str:
    """By how much a figure is less or more than as given."""
    return f"{show(abs(less))} {'less' if less >= 0.0 else 'more'} than as given"


def _briefly(sentence: str, finals: Sequence[Sequence[Final]]) -> str:
    """A sentence about the best with its file instead of its values, which the table below has."""
    _, best = ends(finals)
    return sentence.replace(best[0].placement.key, "best_1.yaml") if best else sentence


def _places(finals: Sequence[Sequence[Final]]) -> str:
    """A table of the best placements: what stands how far from where it is given; "" without
    one.
    """
    others = [own[0] for own in finals if not own[0].is_given and own[0].solved]
    moved = [_displacements(one) for one in others]
    owners = list(dict.fromkeys(owner for own in moved for owner in own))
    if not owners:
        return ""
    rows = [
        (f"<b>{rank}</b>", *(text(own.get(owner, "as given")) for owner in owners))
        for rank, own in enumerate(moved, start=1)
    ]
    heads = ("placement", *owners)
    return table(heads, rows, "What stands how far from where it is given")


def _displacements(one: Final) -> dict[str, str]:
    """What stands how far from where it is given, by owner."""
    by: dict[str, list[str]] = {}
    for name, value in sorted(one.placement.values.items()):
        owner, _, part = name.removeprefix(_MACHINE).rpartition(".")
        amount = f"{value:+g}°" if part.endswith("_deg") else f"{100.0 * value:+.4g}\u202fcm"
        shown = f"{part.removesuffix('_deg')}\u202f{amount}"
        if value:
            by.setdefault(owner, []).append(shown)
    return {owner: ", ".join(own) for owner, own in by.items()}


def _rows(finals: Sequence[Sequence[Final]], costs: Costs) -> Iterator[tuple[str, ...]]:
    """Cells of the table, a row for each condition of each placement."""
    given, _ = ends(finals)
    rank = 0
    for own in finals:
        rank += not own[0].is_given
        for one in own:
            name = "as given" if one.is_given else f"placement {rank}"
            if not one.solved:
                yield name, text(one.condition.text), *[DASH] * (len(_HEADS) - 2)
                continue
            less = money = DASH
            if given is not None and not one.is_given:
                like = of_condition(given, one)
                year = _year(one, like, costs)
                share = percent(year.energy.value / like.mean()).lstrip("+")
                less = _with_interval(f"{kilowatt_hours(year.energy.value)} ({share})", year.energy)
                between = yearly_span(year.money.low, year.money.high, costs.currency)
                money = (
                    f"<b>{text(yearly_money(year.money.value, costs.currency))}</b>"
                    f"<small>{text(between)} {text(costs.currency)}</small>"
                )
            yield (
                name, text(one.condition.text), money, less,
                _with_interval(kilowatt_hours(one.mean()), one.interval),
                kilowatt_hours(one.mean("moving_j")),
                seconds(one.mean("duration_s")), millimetres(one.mean("clearance_m")),
                kilowatt_hours(one.spread()) if len(one.rows) > 1 else "one seed",
            )  # fmt: skip


def _with_interval(value: str, within: JouleInterval | Amount) -> str:
    """A value with its interval on a line of its own."""
    return f"{value}<small>{span_of(within.low, within.high, kilowatt_hours)}</small>"


def _maps(
    known: Sequence[Known], finals: Sequence[Sequence[Final]], settings: LayoutSettings, cell: Cell
) -> Iterator[str]:
    """One view from above for everything that moves along the floor."""
    _, best = ends(finals)
    star = settings.placing.cell(cell, best[0].placement.values) if best else None
    limits = shown_range(known)
    with_costs = list(zip(known, estimates(known), strict=True))
    with_costs.sort(key=lambda each: _drawn_last(each[0], each[1]))
    on_floor = [each for each in settings.variables if each.part in ("x", "y")]
    owners = [variable.owner for variable in on_floor if variable.owner != "tool"]
    drawings: list[tuple[str, list[Mark]]] = []
    for owner in dict.fromkeys(owners):
        at = place_of(owner, cell)
        marks: list[Mark] = []
        for one, cost in with_costs:
            shift = [one.placement.values.get(f"{owner}.{axis}", 0.0) for axis in "xy"]
            marks.append((at + shift, *_mark_of(one, cost, limits)))
        marks.append((at, "given", "", "as given"))
        if star is not None:
            marks.append((place_of(owner, star), "best", "", "best"))
        drawings.append((owner.removeprefix(_MACHINE), marks))

    # all views have the size of the largest: they are compared
    places = [np.array([place for place, *_ in marks]) for _, marks in drawings]
    sizes = [PlanView(cell, star, own_places).size for own_places in places]
    for (name, marks), own_places in zip(drawings, places, strict=True):
        view = PlanView(cell, star, own_places, np.max(sizes, axis=0))
        title = f"{name}, {view.across:.1f} m from edge to edge"
        yield f"<div><h3>{text(title)}</h3>{view.drawn(f'Where {name} stands', marks)}</div>"


def _kinds(known: Sequence[Known], finals: Sequence[Sequence[Final]]) -> set[str]:
    """Kinds of the marks that maps have."""
    costs = estimates(known)
    marks = {_mark_of(one, cost, (0.0, 0.0))[0] for one, cost in zip(known, costs, strict=True)}
    return {*marks, "given"} | ({"best"} if ends(finals)[1] else set())


_LEAST_MOVE = 5e-3  # m: less is not drawn


def _moved_plan(finals: Sequence[Sequence[Final]], settings: LayoutSettings, cell: Cell) -> str:
    """A section: the whole cell from above as it is and by the best placement, an arrow for all
    that moves; "" where nothing does.
    """
    _, best = ends(finals)
    if best is None:
        return ""
    values = best[0].placement.values
    star = settings.placing.cell(cell, values)
    moves: dict[str, Move] = {}
    for owner in dict.fromkeys(v.owner for v in settings.variables):
        if owner != "base" and not owner.startswith(_MACHINE):
            continue
        start = place_of(owner, cell)
        end = place_of(owner, star)
        along = float(np.hypot(*(end - start)))
        up = values.get(f"{owner}.z", 0.0)
        said = [f"{100.0 * along:.0f} cm"] if along >= _LEAST_MOVE else []
        said += [f"{'up' if up > 0.0 else 'down'} {100.0 * abs(up):.0f} cm"] if up else []
        if said:
            moves[owner] = (start, end, f"{owner.removeprefix(_MACHINE)} {', '.join(said)}")
    if not moves:
        return ""
    names = {
        machine.name: np.array(machine.pose[:2, 3])
        for machine in cell.equipment
        if f"{_MACHINE}{machine.name}" not in moves
    }
    near = np.vstack([points for one in (cell, star) for points in outlines(one)])
    view = PlanView(cell, star, near, close=True)
    words = "; ".join(each for *_, each in moves.values())
    drawn = view.drawn(f"The cell from above, moved: {words}", [], list(moves.values()), names)
    return (
        '<section id="moved"><h2>The cell from above, as given and by placement 1</h2>'
        '<p class="hint">Grey: as given; dashed: placement 1, the best. Arrows: what moves, and '
        f"how far.</p>{drawn}</section>"
    )


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
    return kind, colour(cost, *limits), f"{one.placement.key}: {words}{kilowatt_hours(cost)}"


def _charts(
    known: Sequence[Known], finals: Sequence[Sequence[Final]], settings: LayoutSettings
) -> Iterator[str]:
    low, high = shown_range(known)
    if math.isfinite(low):
        for variable in settings.variables:
            yield _chart(variable, known, low, max(high, low * 1.001))


def _chart(variable: Variable, known: Sequence[Known], low: float, high: float) -> str:
    """Cost over one variable, as SVG; what is dearer than shown stands at the upper edge. low,
    high: costs [J] at both ends of the axis.
    """
    width = max(variable.high - variable.low, 1e-9)
    bottom = _HIGH - _BELOW
    marks = []
    for one in sorted(known, key=lambda one: _drawn_last(one, one.cost)):
        value = one.placement.values.get(variable.name, 0.0)
        if not math.isfinite(one.cost):
            continue
        share = min((one.cost - low) / (high - low), 1.0)
        x = _LEFT + (_CHART - _LEFT - 10.0) * (value - variable.low) / width
        y = 10.0 + (_HIGH - _BELOW - 10.0) * (1.0 - share)
        kind = "given" if one.placement.key == GIVEN.key else "dot"
        words = f"{variable.name} {value:g} {variable.unit}: {kilowatt_hours(one.cost)}"
        marks.append(mark(x, y, kind, colour(one.cost, low, high), words))
    numbers = []
    ends_of = ((_LEFT, "start", variable.low), (_CHART - 10.0, "end", variable.high))
    for x, anchor, value in ends_of:
        numbers.append(
            f'<text x="{x:g}" y="{_HIGH - 10:g}" text-anchor="{anchor}">{value:g} '
            f"{variable.unit}</text>"
        )
    span_wh = max(high - low, 1e-6) / 3600.0
    decimals = max(0, 1 - math.floor(math.log10(span_wh)))
    for y, value in ((16.0, high), (bottom, low)):
        shown_wh = f"{value / 3600.0:.{decimals}f}"
        numbers.append(f'<text x="{_LEFT - 6:g}" y="{y:g}" text-anchor="end">{shown_wh}</text>')
    line = f'<path class="grid" d="M{_LEFT:g} 8V{bottom + 4:g}H{_CHART - 6:g}"/>'
    return (
        f"<figure><figcaption>{text(variable.name)} (Wh)</figcaption>"
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


# Files: the table, the best placements as cell files, the page.

_TABLE_START = b"placement,"
_CELL_START = b"format: ir_cell/1"
NUMBERS = (
    "cost_j", "energy_j", "energy_low_j", "energy_high_j", "duration_s", "moving_j", "moving_s", "drives_j",  # noqa: E501
    "clearance_m",
)  # fmt: skip
_BEST_HEADS = (
    "rank,placement,condition,energy_j,low_j,high_j,spread_j,duration_s,moving_j,"
    "saved_j,saved_low_j,saved_high_j"
)
Value: TypeAlias = "str | float | int"


def write_outputs(
    known: Sequence[Known],
    finals: Sequence[Sequence[Final]],
    settings: LayoutSettings,
    given: Cell,
    folder: Path,
) -> tuple[tuple[Path, ...], str]:
    """Write table.csv, best_1.yaml and so on, index.html; the files, and the best as CSV. given:
    the cell as it was when the study began.

    Raises RecorderError for files that can't be written, or replaced.
    """
    rows = [
        _placement_values(k, one, c, settings)
        for k, one in enumerate(known)
        for c in settings.conditions
    ]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    written = [write_columns(columns, folder / "table.csv", _TABLE_START, ANYWHERE)]
    others = [own for own in finals if not own[0].is_given]
    for rank, own in enumerate(others, start=1):
        cell = settings.placing.cell(given, own[0].placement.values)
        content = cell_to_yaml(replace(cell, name=f"{cell.name}_best_{rank}")).encode()
        written.append(write_output(folder / f"best_{rank}.yaml", content, _CELL_START, ANYWHERE))
    _remove_best(folder, given.name, len(others))
    written.append(write_page(known, finals, settings, given, folder / "index.html"))
    return tuple(written), best_table(finals)


def _remove_best(folder: Path, name: str, kept: int) -> None:
    """Remove the best of a study in this folder that kept more; other cells stay."""
    for path in folder.glob("best_*.yaml"):
        rank = path.stem.removeprefix("best_")
        if rank.isdecimal() and int(rank) > kept and _is_named(path, f"{name}_best_{rank}"):
            path.unlink()


def _is_named(path: Path, name: str) -> bool:
    """Whether a file is a cell of that name, as it was written here."""
    if path.is_symlink() or not path.is_file():
        return False
    content = path.read_bytes()
    return content.startswith(_CELL_START) and f"name: {name}".encode() in content.splitlines()


def _placement_values(
    k: int, known: Known, condition: PlacementCondition, settings: LayoutSettings
) -> dict[str, Value]:
    plan = known.plans.get(condition, {})
    kind, sentence = known.reason
    state = "impossible" if known.cost == math.inf else "planned" if known.planned else "looked at"
    return {
        "placement": k,
        **{
            variable.name: known.placement.values.get(variable.name, 0.0)
            for variable in settings.variables
        },
        "condition": condition.text,
        "state": state,
        "reason": kind,
        "sentence": sentence,
        "coarse_j": known.coarse if math.isfinite(known.coarse) else math.nan,
        **{name: float(plan.get(name, math.nan)) for name in NUMBERS},
        "program_id": str(plan.get("program_id", "")),
    }


def best_table(finals: Sequence[Sequence[Final]]) -> str:
    """CSV: the given placement and the best by condition, with their error bars."""
    given, _ = ends(finals)
    lines = [_BEST_HEADS]
    rank = 0
    for own in finals:
        rank += not own[0].is_given
        for one in own:
            if not one.solved:
                continue
            within = one.interval
            figures = [
                one.mean(),
                within.low,
                within.high,
                one.spread(),
                one.mean("duration_s"),
                one.mean("moving_j"),
            ]
            if given is not None:
                less, saved = one.saving(of_condition(given, one))
                figures += [less, saved.low, saved.high]
            else:
                figures += [math.nan] * 3
            texts = (str(rank if not one.is_given else 0), one.placement.key, one.condition.text)
            lines.append(",".join([*texts, *(f"{value:.3f}" for value in figures)]))
    return "\n".join(lines) + "\n"
