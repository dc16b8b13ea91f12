"""A robot that tends machines: its parts as a table, and for each a Gantt chart of robot, power
modes, machines and power at the mains.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ir_recorder.analysis import Analysis
from ir_recorder.analysis.results import mode_name
from ir_recorder.analysis.tending import PartRow, Span, Tending
from ir_recorder.reading.recording import PowerSeries
from ir_recorder.report.number_text import DASH, joules, mode_words, seconds, text, watts
from ir_recorder.report.tables import table

# A drawing of one part. It is as narrow as a telephone, so that its letters stay readable there.

_WIDTH = 420.0
_LEFT = 76.0
_RIGHT = 8.0
_ROW = 20.0
_BAR = 13.0
_POWER = 54.0
_AXIS = 22.0
_BINS = 120  # means of power over a part's time
_TICKS = 6
_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)


def tending_section(analysis: Analysis) -> str:
    """The section of a cell with a route of which parts were driven; "" for another."""
    tending = analysis.tending
    if tending is None:
        return ""
    charts = "".join(_figure(part, tending, analysis.recording.power) for part in tending.parts)
    return (
        '<section id="tending"><h2>Parts: what each took, and who waited for whom</h2>'
        f"{_parts(tending)}{_legend()}{charts}</section>"
    )


def _parts(tending: Tending) -> str:
    figures = (">time", ">planned", ">energy", ">predicted")
    heads = ("part", *figures, "robot waited for", "part waited in")
    rows = []
    for part in tending.parts:
        name = f"{part.number}"
        if part.number <= tending.filling:
            name += " <small>fills the line</small>"
        late = {f"{name}, late": value for name, value in part.late.items()}
        rows.append(
            (
                name,
                seconds(part.span.seconds),
                seconds(part.planned_seconds),
                f"<b>{joules(part.joules)}</b>",
                joules(part.planned_joules),
                _waits({**part.paused, **late}),
                _waits(part.finished),
            )
        )
    return table(heads, rows, "Parts")


def _waits(waits: Mapping[str, float]) -> str:
    said = [f"{text(name)} {seconds(value)}" for name, value in waits.items()]
    return "<br>".join(said) or DASH


def _legend() -> str:
    kinds = (
        ("loaded", "robot with a part, machine at work"),
        ("empty", "robot without, finished part that waits"),
        ("late", "robot waits for a late signal"),
    )
    words = "".join(
        f'<span><svg class="gantt key" viewBox="0 0 10 10"><rect class="{kind}" width="10" '
        f'height="10"/></svg> {name}</span> '
        for kind, name in kinds
    )
    return f'<p class="key-row">{words}</p>'


def _figure(part: PartRow, tending: Tending, power: PowerSeries | None) -> str:
    chart = _Chart(part.span)
    chart.lane("robot", _robot(part, tending))
    if power is not None:
        chart.lane("mode", _modes(power, part.span))
    for machine in tending.machines:
        bars = [("loaded", span, "at work") for span in machine.working]
        bars += [("empty", span, "finished, waits for the robot") for span in machine.finished]
        chart.lane(machine.name, bars)
    if power is not None and len(power.time) > 1:
        chart.power(power)
    said = f"part {part.number}: {seconds(part.span.seconds)}, {joules(part.joules)}"
    return (
        f'<figure class="figure"><figcaption>{text(said)}</figcaption>'
        f"{chart.drawn(f'part_{part.number}', said)}</figure>"
    )


_Bar = tuple[str, Span, str]
"""Its style, its time, and what it is."""


def _robot(part: PartRow, tending: Tending) -> list[_Bar]:
    bars: list[_Bar] = []
    carrying = False
    for step in tending.steps:
        movement = step.movement
        if step.start > step.begin:
            bars.append(("late", Span(step.begin, step.start), "waits for a signal"))
        if not movement.since:
            style = "loaded" if carrying else "empty"
            words = f"{movement.kind} {movement.to_station}"
            bars.append((style, Span(step.start, step.end), words))
        carrying = bool(movement.attach) or (carrying and not movement.detach)
    return [bar for bar in bars if bar[1].within(part.span.begin, part.span.end) > 0.0]


def _modes(power: PowerSeries, span: Span) -> list[_Bar]:
    inside = (power.time >= span.begin) & (power.time <= span.end)
    times = power.time[inside]
    modes = power.mode[inside]
    if not len(times):
        return []
    begins = np.concatenate(([0], np.flatnonzero(np.diff(modes)) + 1, [len(times)]))
    return [
        (
            f"m-{mode_name(int(modes[a]))}",
            Span(float(times[a]), float(times[min(b, len(times) - 1)])),
            mode_words(mode_name(int(modes[a]))),
        )
        for a, b in zip(begins[:-1].tolist(), begins[1:].tolist(), strict=True)
    ]


class _Chart:
    """Lanes below each other over the time of a part, then its power."""

    def __init__(self, span: Span) -> None:
        self._span = span
        self._parts: list[str] = []
        self._height = 4.0

    def lane(self, name: str, bars: Sequence[_Bar]) -> None:
        """A named row of bars."""
        top = self._height
        self._parts.append(f'<text x="0" y="{top + 11:.1f}">{text(name)}</text>')
        for style, span, words in bars:
            left = self._at(max(span.begin, self._span.begin))
            right = self._at(min(span.end, self._span.end))
            if right <= left:
                continue
            said = f"{words}, {seconds(span.seconds)}"
            self._parts.append(
                f'<rect class="{text(style)}" x="{left:.2f}" y="{top:.1f}" '
                f'width="{right - left:.2f}" height="{_BAR}"><title>{text(said)}</title></rect>'
            )
        self._height += _ROW

    def power(self, power: PowerSeries) -> None:
        """Mean power at the mains."""
        edges = np.linspace(self._span.begin, self._span.end, _BINS + 1)
        means = np.diff(np.interp(edges, power.time, power.energy)) / np.diff(edges)
        most = max(float(means.max()), 1.0)
        low = self._height + _POWER
        heights = low - (_POWER - 8.0) * np.maximum(means, 0.0) / most
        middles = 0.5 * (edges[1:] + edges[:-1])
        points = " ".join(
            f"{self._at(x):.1f},{y:.1f}"
            for x, y in zip(middles.tolist(), heights.tolist(), strict=True)
        )
        self._parts.append(f'<text x="0" y="{self._height + 16:.1f}">{watts(most)}</text>')
        self._parts.append(f'<text x="0" y="{low:.1f}">0 W</text>')
        self._parts.append(f'<polyline class="power" points="{points}"/>')
        self._height = low + 4.0

    def drawn(self, name: str, said: str) -> str:
        """The drawing with its axis of time."""
        step = next((s for s in _STEPS if self._span.seconds / s <= _TICKS), _STEPS[-1])
        ticks = np.arange(0.0, self._span.seconds + 1e-9, step)
        places = [(tick, self._at(self._span.begin + tick)) for tick in ticks.tolist()]
        down = f"{self._height:.1f}"
        lines = "".join(f'<path class="grid" d="M{x:.1f} 0V{down}"/>' for _, x in places)
        below = f"{self._height + 14.0:.1f}"
        labels = "".join(
            f'<text text-anchor="middle" x="{x:.1f}" y="{below}">{tick:g} s</text>'
            for tick, x in places
        )
        height = self._height + _AXIS
        return (
            f'<svg class="gantt" id="{name}" viewBox="0 0 {_WIDTH:g} {height:g}" role="img" '
            f'aria-label="{text(said)}">{lines}{"".join(self._parts)}{labels}</svg>'
        )

    def _at(self, time: float) -> float:
        share = (time - self._span.begin) / self._span.seconds
        return _LEFT + share * (_WIDTH - _LEFT - _RIGHT)
