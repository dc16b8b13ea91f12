"""Energy over cycle time with its Pareto front, as SVG; and marks by which series differ."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ir_msgs_py.savings import ProgramPoint
from ir_recorder.analysis import Analysis
from ir_recorder.report.bars import TICKS, tick_step
from ir_recorder.report.number_text import joules, kilowatt_hours, seconds, text

_ALONG = 2.5  # labels of cycle times, about: they are wide
# How named curves and points of one drawing differ: by a colour, a mark, and beyond seven by a
# dash too.
#
# The colours are those of Okabe and Ito, which the colour-blind distinguish; axes.js draws curves
# with them.

COLOURS = 7
MARKS = (
    "M-4 0A4 4 0 1 0 4 0A4 4 0 1 0 -4 0Z",
    "M-3.6 -3.6H3.6V3.6H-3.6Z",
    "M0 -4.8L4.6 3.4H-4.6Z",
    "M0 -5.2L5.2 0L0 5.2L-5.2 0Z",
    "M0 4.8L4.6 -3.4H-4.6Z",
    "M-1.4 -4.6H1.4V-1.4H4.6V1.4H1.4V4.6H-1.4V1.4H-4.6V-1.4H-1.4Z",
    "M-5 -2H5V2H-5Z",
    "M-2 -5H2V5H-2Z",
)
"""SVG paths about the origin; as many as share no factor with the colours, so that 56 pairs
differ.
"""


def mark(index: int, x: float, y: float, inside: str) -> str:
    """The mark of a series at a place of a drawing, as SVG around what belongs to it."""
    path = MARKS[index % len(MARKS)]
    colour = index % COLOURS + 1
    place = f"translate({x:.1f} {y:.1f})"
    return f'<path class="s{colour}" transform="{place}" d="{path}">{inside}</path>'


# Energy over cycle time as a drawing: programs as points, those that no other one beats joined by
# a line.

WIDTH = 560.0
HEIGHT = 300.0
_LEFT = 108.0
_RIGHT = 150.0
_TOP = 18.0
_BOTTOM = 44.0
# how wide and how high a name is, and how far it stands below its middle
_NAME = 130.0
_LINE = 18.0
_HALF = 4.0
_SAME_TIME = 0.01  # of the longest cycle: times that differ by less are one
# span of an axis: what differs by less reads alike
_LEAST_S = 0.05
_LEAST_J = 5.0
# unit of an axis by its largest value, as number_text writes the same: from which value [SI] on
# it is the larger one
_Units = tuple[float, tuple[str, float], tuple[str, float]]
_SECONDS: _Units = (600.0, ("min", 60.0), ("s", 1.0))
_ENERGIES: dict[Callable[[float], str], _Units] = {
    joules: (10_000.0, ("kJ", 1e3), ("J", 1.0)),
    kilowatt_hours: (3.6e6, ("kWh", 3.6e6), ("Wh", 3600.0)),
}


@dataclass(frozen=True)
class Point:
    """A program: cycle time [s], energy [J] at the mains, and whether that is simulated or
    predicted.
    """

    name: str
    seconds: float
    energy: float
    source: str


def front_section(analysis: Analysis, planned: Sequence[ProgramPoint] = ()) -> str:
    """Section of the page: this run, the planned front, the common program, what was planned in its
    time.
    """
    savings = analysis.savings
    program = analysis.program
    if savings is None and not planned:
        return ""
    total = savings.total if savings is not None else None
    run = program.whole if program is not None and math.isfinite(program.whole.energy) else None
    points = [
        *(
            [Point("this run", run.seconds, run.energy, analysis.recording.origin)]
            if run is not None
            else ()
        ),
        *(Point("", point.cycle_time, point.energy, "predicted") for point in planned),
    ]
    if total is not None:
        points += [
            Point("common program", total.seconds, total.common, "predicted"),
            Point("planned in its time", total.seconds, total.planned, "predicted"),
        ]
    return front_part(points)


def front_part(points: Sequence[Point]) -> str:
    """Section of the page; "" for fewer than two points, and where all programs take one time but
    for a hundredth.
    """
    if len(points) < 2 or _one_time(points):
        return ""
    joined = len(pareto(points)) > 1
    hint = "Left is faster, down is cheaper" + (
        "; the line joins programs that no other one beats in both." if joined else "."
    )
    head = f'<h2>Energy over cycle time</h2><p class="hint">{hint}</p>'
    return f'<section id="front">{head}{front_chart(points, show=kilowatt_hours)}</section>'


def _one_time(points: Sequence[Point]) -> bool:
    times = [point.seconds for point in points]
    return max(times) - min(times) < _SAME_TIME * max(times)


def pareto(points: Sequence[Point]) -> list[Point]:
    """Points that no other one beats, by their time."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.energy)):
        if not best or point.energy < best[-1].energy:
            best.append(point)
    return best


def front_chart(
    points: Sequence[Point], along: str = "cycle time", show: Callable[[float], str] = joules
) -> str:
    """The drawing as SVG, its axis named `along`, its energies in the units of `show` (`joules` or
    `kilowatt_hours`); "" for fewer than two points.
    """
    if len(points) < 2:
        return ""
    times = [p.seconds for p in points]
    energies = [p.energy for p in points]
    x = _Axis(
        min(times), max(times), _LEAST_S, _LEFT, WIDTH - _RIGHT, *_unit(times, _SECONDS), _ALONG
    )
    unit = _unit(energies, _ENERGIES[show])
    y = _Axis(min(energies), max(energies), _LEAST_J, HEIGHT - _BOTTOM, _TOP, *unit)
    line = " ".join(f"{x.at(p.seconds):.1f},{y.at(p.energy):.1f}" for p in pareto(points))
    heights = _heights(points, x, y)
    marks = "".join(_mark_front(point, k, heights[k], x, y, show) for k, point in enumerate(points))
    said = "; ".join(f"{p.name} {seconds(p.seconds)}, {show(p.energy)}, {p.source}" for p in points)
    return (
        '<div class="figure"><svg class="front" id="energy_over_cycle_time" '
        f'viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{text(said)}">'
        f'{_grid(x, y, along)}<polyline class="line" points="{line}"/>{marks}</svg></div>'
    )


def _unit(values: Sequence[float], units: _Units) -> tuple[str, float]:
    since, large, small = units
    return large if max(map(abs, values)) >= since else small


@dataclass(frozen=True)
class _Axis:
    """From values to drawing units, from the label below a margin of a tenth to the one above;
    labels are multiples of a unit.
    """

    low: float
    high: float
    least: float
    start: float
    end: float
    unit: str
    scale: float
    labels: float = TICKS

    @property
    def span(self) -> float:
        """Of what is shown without the margin, the middle of the values in its middle."""
        return max(self.high - self.low, self.least)

    @property
    def lines(self) -> tuple[float, int, int]:
        """The step of its labels, and which multiples of it are the first and the last."""
        step = tick_step(1.2 * self.span / self.scale * TICKS / self.labels)
        middle = 0.5 * (self.low + self.high)
        first = math.floor((middle - 0.55 * self.span) / self.scale / step)
        if self.low >= 0.0:
            first = max(first, 0)
        last = math.ceil((middle + 0.55 * self.span) / self.scale / step)
        return step, first, last

    def at(self, value: float) -> float:
        step, first, last = self.lines
        share = (value / self.scale / step - first) / (last - first)
        return self.start + share * (self.end - self.start)

    def ticks(self) -> dict[float, str]:
        """Where lines stand, with their labels: as many decimals as their step needs."""
        step, first, last = self.lines
        decimals = max(0, math.ceil(-math.log10(step) - 1e-9))
        return {
            k * step * self.scale: f"{k * step:,.{decimals}f} {self.unit}".replace(",", " ")
            for k in range(first, last + 1)
        }


def _grid(x: _Axis, y: _Axis, along: str) -> str:
    right = WIDTH - _RIGHT
    bottom = HEIGHT - _BOTTOM
    parts = []
    for value, shown in y.ticks().items():
        at = y.at(value)
        parts.append(f'<path class="grid" d="M{_LEFT:g} {at:.1f}H{right:g}"/>')
        parts.append(f'<text x="{_LEFT - 8:g}" y="{at + 4:.1f}" text-anchor="end">{shown}</text>')
    for value, shown in x.ticks().items():
        at = x.at(value)
        parts.append(f'<path class="grid" d="M{at:.1f} {_TOP:g}V{bottom:g}"/>')
        parts.append(f'<text x="{at:.1f}" y="{bottom + 21:g}" text-anchor="middle">{shown}</text>')
    middle = (_LEFT + right) / 2.0
    return (
        "".join(parts)
        + f'<text x="{middle:g}" y="{HEIGHT - 4:g}" text-anchor="middle">{along}</text>'
    )


def _heights(points: Sequence[Point], x: _Axis, y: _Axis) -> list[float]:
    """Where the names of points go: beside them, or below another name that stands there, and all
    of them higher where the last would stand below the drawing.
    """
    heights = [y.at(point.energy) for point in points]
    named = sorted((k for k, point in enumerate(points) if point.name), key=heights.__getitem__)
    placed: list[tuple[float, float]] = []
    for k in named:
        at = x.at(points[k].seconds)
        for other, high in sorted(placed, key=lambda one: one[1]):
            if abs(other - at) < _NAME and abs(high - heights[k]) < _LINE:
                heights[k] = high + _LINE
        placed.append((at, heights[k]))
    below: list[tuple[float, float]] = []
    for k in sorted(named, key=heights.__getitem__, reverse=True):
        at = x.at(points[k].seconds)
        lower = [high - _LINE for other, high in below if abs(other - at) < _NAME]
        heights[k] = min(heights[k], HEIGHT - _BOTTOM - _HALF, *lower)
        below.append((at, heights[k]))
    return heights


def _mark_front(
    point: Point, index: int, label: float, x: _Axis, y: _Axis, show: Callable[[float], str]
) -> str:
    at = x.at(point.seconds)
    high = y.at(point.energy)
    name = point.name or "program of the front"
    words = f"{name}, {point.source}: {seconds(point.seconds)}, {show(point.energy)}"
    title = f"<title>{text(words)}</title>"
    if point.source == "predicted":
        drawn = f'<circle class="hollow" cx="{at:.1f}" cy="{high:.1f}" r="6">{title}</circle>'
    else:
        drawn = mark(index, at, high, title)
    leader = (
        f'<path class="grid" d="M{at:.1f} {high:.1f}L{at + 10:.1f} {label:.1f}"/>'
        if label != high
        else ""
    )
    return (
        f'{leader}{drawn}<text x="{at + 12:.1f}" y="{label + 4:.1f}" '
        f'class="name">{text(point.name)}</text>'
    )
