"""Gantt charts: lanes of bars below each other, then power at the mains, over one axis of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ir_recorder.analysis.results import mode_name
from ir_recorder.analysis.tending import Span
from ir_recorder.reading.recording import PowerSeries
from ir_recorder.report.number_text import mode_words, seconds, text, watts
from ir_recorder.report.series import stretches
from ir_values.arrays import FloatArray

# It is as narrow as a telephone, so that its letters stay readable there.

_WIDTH = 420.0
_LEFT = 76.0
_RIGHT = 8.0
_ROW = 20.0
_BAR = 13.0
_POWER = 54.0
_AXIS = 22.0
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


_MODES = ("MOVING", "STAND_ON_MOTORS", "STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION")


def legend(kinds: Mapping[str, str]) -> str:
    """What the styles of bars and the colours of the power modes mean."""
    words = "".join(
        f'<span><svg class="gantt key" viewBox="0 0 10 10"><rect class="{kind}" width="10" '
        f'height="10"/></svg> {text(name)}</span> '
        for kind, name in kinds.items()
    )
    modes = "".join(
        f'<span><i class="key m-{mode}"></i>{mode_words(mode)}</span> ' for mode in _MODES
    )
    between = '<span><i class="key"></i>between two modes</span>'
    return (
        f'<p class="key-row">{words}<span>power: from its lowest to its highest value</span></p>'
        f'<p class="key-row"><b>mode:</b> {modes}{between}</p>'
    )


class Gantt:
    """Lanes below each other over a span, then power."""

    def __init__(self, span: Span) -> None:
        self._span = span
        self._parts: list[str] = []
        self._height = 4.0

    def lane(self, name: str, bars: Sequence[Bar]) -> None:
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

    def power(self, meters: Sequence[PowerSeries]) -> None:
        """Power at the mains of all meters together, every peak kept."""
        edges = np.linspace(self._span.begin, self._span.end, _BINS + 1)
        shape = stretches(edges, *together(meters))
        most = max(float(shape.high.max()), 1.0)
        low = self._height + _POWER
        ends = np.stack([shape.low, shape.high], axis=1).ravel()
        heights = low - (_POWER - 8.0) * np.maximum(ends, 0.0) / most
        points = " ".join(
            f"{self._at(x):.1f},{y:.1f}"
            for x, y in zip(np.repeat(shape.time, 2).tolist(), heights.tolist(), strict=True)
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
