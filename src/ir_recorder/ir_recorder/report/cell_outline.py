"""Views of a cell along one direction: machines as outlines, configurations as capsules, paths."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ir_description import Body, Cell
from ir_recorder.report.number_text import text
from ir_recorder.report.shapes import body_mesh
from ir_values.arrays import FloatArray

WIDTH = 560.0
HEIGHT = 360.0
_MARGIN = 24.0
_LEAST = 0.4  # m: less is not shown, however short a path is
_SEEN = 9.0  # of a machine, by each letter of its name, so that the name may stand there
# m; the longest bar
_LENGTHS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
_BAR = 0.3 * WIDTH


@dataclass(frozen=True, eq=False)
class View:
    """axes (3, 2): directions to the right and up; centre (2,) m of what is shown; scale: units per
    metre.
    """

    axes: FloatArray
    centre: FloatArray
    scale: float

    @staticmethod
    def of(points: FloatArray, right: FloatArray, up: FloatArray, around: float) -> View:
        """The view in which points (N, 3) are seen with `around` metres around them."""
        axes = np.column_stack([right, up])
        flat = points @ axes
        low = flat.min(axis=0) - around
        high = flat.max(axis=0) + around
        size = np.maximum(high - low, _LEAST)
        scale = float(np.min((np.array([WIDTH, HEIGHT]) - 2.0 * _MARGIN) / size))
        return View(axes, (low + high) / 2.0, scale)

    @staticmethod
    def from_the_side(points: FloatArray, along: FloatArray, around: float) -> View:
        """The view with z up and the horizontal part of `along` (3,) to the right."""
        flat = np.array([along[0], along[1], 0.0])
        length = float(np.linalg.norm(flat))
        right = flat / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
        return View.of(points, right, np.array([0.0, 0.0, 1.0]), around)

    @property
    def away(self) -> FloatArray:
        """The direction (3,) of the view."""
        return np.cross(self.axes[:, 0], self.axes[:, 1])

    def flat(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) as (N, 2) of the drawing."""
        moved = (np.atleast_2d(points) @ self.axes - self.centre) * self.scale
        return np.asarray(moved * [1.0, -1.0] + [WIDTH / 2.0, HEIGHT / 2.0])

    def line(self, points: FloatArray, style: str) -> str:
        """A path (N, 3)."""
        return f'<polyline class="{style}" points="{_listed(self.flat(points))}"/>'

    def dots(self, points: FloatArray, style: str, radius: float) -> str:
        """Points (N, 3), each a dot."""
        marks = "".join(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}"/>' for x, y in self.flat(points)
        )
        return f'<g class="{style}">{marks}</g>' if len(points) else ""

    def crosses(self, points: FloatArray, style: str, radius: float) -> str:
        """Points (N, 3), each a cross."""
        arm = f"l{2.0 * radius:g} {2.0 * radius:g}m0 {-2.0 * radius:g}l{-2.0 * radius:g} "
        marks = "".join(
            f'<path d="M{x - radius:.1f} {y - radius:.1f}{arm}{2.0 * radius:g}"/>'
            for x, y in self.flat(points)
        )
        return f'<g class="{style}">{marks}</g>' if len(points) else ""

    def segments(self, first: FloatArray, second: FloatArray, style: str) -> str:
        """Lines between pairs of points (N, 3)."""
        ends = zip(self.flat(first), self.flat(second), strict=True)
        path = "".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in ends)
        return f'<path class="{style}" d="{path}"/>' if path else ""

    def machines(
        self, cell: Cell, station: str, near: FloatArray | None = None, depth: float = np.inf
    ) -> str:
        """The bodies of the machines, those of others than the station's as outlines ("": of none);
        with `near` (3,) those of its machine alone, as outlines what isn't within `depth` m of the
        plane there.
        """
        own = cell.station(station).equipment if station else ""
        parts = []
        for machine in cell.equipment:
            within = depth if own in ("", machine.name) else -np.inf
            if near is None or own == machine.name:
                parts += [self._outline(body, near, within) for body in machine.world_bodies()]
        return "".join(parts)

    def _outline(self, body: Body, near: FloatArray | None, depth: float) -> str:
        mesh = body_mesh(body)
        if mesh is None:
            return ""
        points = mesh.points @ np.asarray(body.pose)[:3, :3].T + np.asarray(body.pose)[:3, 3]
        off = (points - (points[0] if near is None else near)) @ self.away
        style = "body" if off.min() < depth and off.max() > -depth else "body behind"
        shape = _listed(_hull(self.flat(points)))
        return (
            f'<polygon class="{style}" points="{shape}"><title>{text(body.name)}</title></polygon>'
        )

    def held(self, cell: Cell, load: str, tcp: FloatArray) -> str:
        """Tool and part named in `load` ("gripper+gear") where the tcp has the pose (4, 4)."""
        names = load.split("+")
        part = next((part.name for part in cell.parts if part.name in names), "")
        flange = tcp @ np.linalg.inv(cell.tcp)
        lines = []
        for each in cell.loads(part):
            for capsule in each.capsules:
                ends = np.stack([capsule.p0, capsule.p1]) @ flange[:3, :3].T + flange[:3, 3]
                (x0, y0), (x1, y1) = self.flat(ends)
                style = "part" if each.kind == "part" else "tool"
                wide = 2.0 * capsule.radius * self.scale
                lines.append(
                    f'<path class="{style}" d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1 + 0.01:.2f}" '
                    f'stroke-width="{wide:.1f}"><title>{text(capsule.name)}</title></path>'
                )
        return "".join(lines)

    def names(self, cell: Cell, only: str = "") -> str:
        """The name of each machine, or of one alone, in the middle of what is seen of its
        bodies.
        """
        parts = []
        for machine in cell.equipment:
            corners = [_corners(body) for body in machine.world_bodies() if body.kind != "plane"]
            if not corners or only not in ("", machine.name):
                continue
            flat = self.flat(np.vstack(corners))
            low = np.clip(flat.min(axis=0), 0.0, [WIDTH, HEIGHT])
            high = np.clip(flat.max(axis=0), 0.0, [WIDTH, HEIGHT])
            x, y = (low + high) / 2.0
            if (high - low >= [_SEEN * len(machine.name), _SEEN]).all() or (
                0.0 < flat.mean(axis=0)[0] < WIDTH and 0.0 < flat.mean(axis=0)[1] < HEIGHT
            ):
                parts.append(
                    f'<text class="name" x="{x:.1f}" y="{y:.1f}" text-anchor="middle">'
                    f"{text(machine.name)}</text>"
                )
        return "".join(parts)

    def scale_bar(self, seen: str) -> str:
        """A length to compare with, and from where the drawing is `seen`."""
        lengths = [length for length in _LENGTHS if length * self.scale <= _BAR]
        length = max(lengths, default=_LENGTHS[0])
        x = _MARGIN / 2.0
        y = HEIGHT - _MARGIN / 2.0
        bar = f'<path class="bar" d="M{x:g} {y - 6:g}v6h{length * self.scale:.1f}v-6"/>'
        words = f"{length:g} m, seen {seen}"
        return f'{bar}<text x="{x + length * self.scale + 8:.1f}" y="{y:g}">{words}</text>'


def drawing(content: Iterable[str], label: str, name: str) -> str:
    """The drawing as SVG."""
    return (
        f'<div class="figure"><svg class="method" id="{name}" viewBox="0 0 {WIDTH:g} '
        f'{HEIGHT:g}" role="img" aria-label="{text(label)}">{"".join(content)}</svg></div>'
    )


def _corners(body: Body) -> FloatArray:
    """Corners (8, 3) of the box of a body along the axes."""
    low, high = body.bounds()
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )


def _listed(points: FloatArray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _hull(points: FloatArray) -> FloatArray:
    """The convex hull of points (N, 2), counter-clockwise (Andrew's monotone chain)."""
    rows = sorted({(round(float(x), 2), round(float(y), 2)) for x, y in points})
    if len(rows) < 3:
        return np.array(rows)

    def half(ordered: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
        kept: list[tuple[float, float]] = []
        for p in ordered:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], p) <= 0.0:
                kept.pop()
            kept.append(p)
        return kept[:-1]

    return np.array(half(rows) + half(reversed(rows)))


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
