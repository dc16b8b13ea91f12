"""Gantt charts: lanes of bars below each other, then power at the mains, over one axis of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ir_msgs_py.modes import REST_MODES, Mode
from ir_recorder.analysis.results import mode_name
from ir_recorder.analysis.tending import Span
from ir_recorder.reading.recording import PowerSeries
from ir_recorder.report.number_text import mode_words, seconds, text, watts
from ir_recorder.report.series import stretches
from ir_values.arrays import FloatArray

# Bars are placed in percent of the time, so that letters have one size on every screen.

_LETTER = 6.4  # px, of a lane's name
_RIGHT = 16.0
_ROW = 22.0
_POWER = 70.0
_AXIS = 22.0
_BAR = 14.0
_BETWEEN = 1.5  # of bars between two modes
_HEIGHTS = {
    "late": 20.0,
    "loaded": _BAR,
    "empty": 5.0,
    "m-EMERGENCY_STOP": _BAR,
    "m-MOVING": _BAR,
    "m-STAND_ON_MOTORS": 10.5,
    "m-STAND_ON_BRAKES": 7.5,
    "m-BUS_POWER_OFF": 5.0,
    "m-HIBERNATION": 3.0,
}
"""What a bar is doesn't stand in its colour alone."""
_BINS = 300  # stretches of a chart's time; of each the lowest and the highest power are drawn
_TICKS = 6
_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)


Bar = tuple[str, Span, str]
"""Its style, its time, and what it is."""


def mode_bars(power: PowerSeries, span: Span) -> list[Bar]:
    """The power modes of a robot in a span."""
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


def together(meters: Sequence[PowerSeries]) -> tuple[FloatArray, FloatArray]:
    """Times (N,) s of all readings, and the power (N,) W of all meters together at each."""
    time = np.unique(np.concatenate([meter.time for meter in meters]))
    return time, np.sum([np.interp(time, m.time, m.power) for m in meters], axis=0)


_MODES = (Mode.MOVING.name, *REST_MODES)


def legend(kinds: Mapping[str, str]) -> str:
    """What the styles of bars, and the colours and heights of the power modes mean."""
    words = "".join(f"<span>{_sample(kind)} {text(name)}</span> " for kind, name in kinds.items())
    modes = "".join(f"<span>{_sample(f'm-{mode}')} {mode_words(mode)}</span> " for mode in _MODES)
    between = f"<span>{_sample('m-transition')} between two modes</span>"
    return f'<p class="key-row">{words}</p><p class="key-row"><b>mode:</b> {modes}{between}</p>'


def _sample(kind: str) -> str:
    high = 0.7 * _high(kind)
    rect = f'<rect class="{kind}" y="{14.0 - high:g}" width="12" height="{high:g}"/>'
    return f'<svg class="gantt key" viewBox="0 0 12 14" aria-hidden="true">{rect}</svg>'


def _high(style: str) -> float:
    return _HEIGHTS.get(style, _BETWEEN)


class Gantt:
    """Lanes below each other over a span, then power."""

    def __init__(self, span: Span) -> None:
        self._span = span
        self._names: list[tuple[str, float]] = []
        self._parts: list[str] = []
        self._height = 4.0

    def lane(self, name: str, bars: Sequence[Bar]) -> None:
        """A named row of bars that stand on one line."""
        low = self._height + _BAR
        self._names.append((name, low - 3.0))
        for style, span, words in bars:
            left = self._at(max(span.begin, self._span.begin))
            right = self._at(min(span.end, self._span.end))
            if right <= left:
                continue
            said = f"{words}, {seconds(span.seconds)}"
            high = _high(style)
            self._parts.append(
                f'<rect class="{text(style)}" x="{left:.2f}%" y="{low - high:.1f}" '
                f'width="{right - left:.2f}%" height="{high:g}"><title>{text(said)}</title></rect>'
            )
        self._height += _ROW

    def power(self, meters: Sequence[PowerSeries]) -> None:
        """Power at the mains of all meters together, every peak kept."""
        edges = np.linspace(self._span.begin, self._span.end, _BINS + 1)
        shape = stretches(edges, *together(meters))
        most = max(float(shape.high.max()), 1.0)
        top = self._height + 8.0
        high = _POWER - 12.0
        ends = np.stack([shape.low, shape.high], axis=1).ravel()
        heights = high * (1.0 - np.maximum(ends, 0.0) / most)
        across = (np.repeat(shape.time, 2) - self._span.begin) / self._span.seconds * _BINS
        points = " ".join(
            f"{x:.1f},{y:.1f}" for x, y in zip(across.tolist(), heights.tolist(), strict=True)
        )
        self._names += [(watts(most), top + 9.0), ("0 W", top + high)]
        self._parts.append(
            f'<svg y="{top:.1f}" width="100%" height="{high:g}" viewBox="0 0 {_BINS} {high:g}" '
            f'preserveAspectRatio="none"><title>power at the mains</title>'
            f'<polygon class="power" points="0,{high:g} {points} {_BINS},{high:g}"/></svg>'
        )
        self._height = top + high + 4.0

    def drawn(self, name: str, said: str) -> str:
        """The drawing with its axis of time, as wide as there is space."""
        step = next((s for s in _STEPS if self._span.seconds / s <= _TICKS), _STEPS[-1])
        ticks = np.arange(0.0, self._span.seconds + 1e-9, step)
        places = [(tick, self._at(self._span.begin + tick)) for tick in ticks.tolist()]
        down = f"{self._height:.1f}"
        lines = "".join(
            f'<line class="grid" x1="{x:.2f}%" x2="{x:.2f}%" y2="{down}"/>' for _, x in places
        )
        below = f"{self._height + 14.0:.1f}"
        labels = "".join(
            f'<text text-anchor="middle" x="{x:.2f}%" y="{below}">{tick:g} s</text>'
            for tick, x in places
        )
        left = 14.0 + _LETTER * max((len(words) for words, _ in self._names), default=0)
        names = "".join(
            f'<text x="{-left:g}" y="{y:.1f}">{text(words)}</text>' for words, y in self._names
        )
        style = f"height:{self._height + _AXIS:g}px;padding:0 {_RIGHT:g}px 0 {left:g}px"
        return (
            f'<svg class="gantt" id="{name}" style="{style}" role="img" '
            f'aria-label="{text(said)}">{names}{lines}{"".join(self._parts)}{labels}</svg>'
        )

    def _at(self, time: float) -> float:
        """Its place in percent of the span."""
        return 100.0 * (time - self._span.begin) / self._span.seconds
