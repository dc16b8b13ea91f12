"""The cell seen from above, with a dot at every place that was looked at, coloured by what it
costs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ir_description import Cell
from ir_msgs_py.arrays import FloatArray
from ir_recorder.report.number_text import joules, text
from ir_recorder.report.shapes import body_mesh, capsule_mesh
from ir_studies.layout.placement import Known

WIDTH = 520.0  # of a drawing; its height follows
_MARGIN = 12.0
_TALLEST = 1.5  # height of a drawing in widths
_AROUND = 0.6  # of the extent of all places that is shown around them
_LEAST_M = 0.3  # m, at least
Mark: TypeAlias = "tuple[FloatArray, str, str, str]"
"""A place (2,) m, its kind, its colour, its words."""
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


def legend(low: float, high: float) -> str:
    """What the colours mean."""
    steps = np.linspace(low, high, len(_COLOURS) + 1)
    keys = (
        f'<span><span class="key" style="background:{one}"></span>{text(joules(float(at)))} '
        "…</span>"
        for one, at in zip(_COLOURS, steps, strict=False)
        if math.isfinite(low)
    )
    rest = ("○ looked at only: estimated", "× impossible", "◆ as given", "★ best_1.yaml")
    return f'<p class="key-row">{"".join(keys)}{"".join(f"<span>{one}</span>" for one in rest)}</p>'


class PlanView:
    """Draws places (2,) m of the world; given and best: the cell as it is and as it should be, as
    far as it lies around places (N, 2), which all are in sight. across: m from edge to edge.
    """

    def __init__(self, given: Cell, best: Cell | None, places: FloatArray) -> None:
        self._outlines = [("was", one) for one in outlines(given)]
        self._outlines += [("best", one) for one in (outlines(best) if best is not None else ())]
        around = max(_AROUND * float(np.ptp(places, axis=0).max()), _LEAST_M)
        self._low = places.min(axis=0) - around
        high = places.max(axis=0) + around
        self.across, up = (float(one) for one in high - self._low)
        self._scale = (WIDTH - 2 * _MARGIN) / max(self.across, up / _TALLEST)
        self._height = self._scale * up + 2 * _MARGIN

    def drawn(self, name: str, marks: Sequence[Mark]) -> str:
        """SVG with marks: place (2,), kind (dot, open, cross, given, best), colour, words."""
        shapes = [
            f'<polygon class="{kind}" '
            f'points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in self._at(points))}"/>'
            for kind, points in self._outlines
        ]
        shapes += [mark(*self._at(place[None])[0], *rest) for place, *rest in marks]
        return (
            f'<svg class="plan" viewBox="0 0 {WIDTH:g} {self._height:.0f}" role="img" '
            f'aria-label="{text(name)}">{"".join(shapes)}</svg>'
        )

    def _at(self, points: FloatArray) -> FloatArray:
        flat = (points - self._low) * self._scale + _MARGIN
        return np.stack([flat[:, 0], self._height - flat[:, 1]], axis=1)


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
    return f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="3" {style}>{title}</circle>'


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
