"""Drawing of paired comparisons: a dot per pair, a bar for the interval of the mean."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ir_recorder.report.bars import tick_step
from ir_recorder.report.number_text import text
from ir_studies.statistics.findings import Comparison

WIDTH = 420.0  # as narrow as a telephone, so that its letters stay readable there
LINE = 26.0
_LETTER = 7.6  # of a name in bold, on average
_GAP = 26.0  # between names and axis: half of the first tick's words
_RIGHT = 26.0
_TOP = 8.0
_BOTTOM = 48.0
_INSIDE = (2.0, 98.0)  # percentiles that the axis holds; dots outside are drawn at its edge
_SPREAD = 7.0  # up and down that dots are moved apart
_BAR = 18.0  # high
_WIDER = 2.0  # than the span, what is divided into ticks: beside the names there is room for five


def dots(comparisons: Sequence[Comparison], title: str) -> str:
    """SVG, its title below the axis; "" where nothing was compared."""
    kept = [each for each in comparisons if each.count]
    if not kept:
        return ""
    first, last, step = _ticks(kept)
    low = first * step
    high = last * step
    height = _TOP + LINE * len(kept) + _BOTTOM
    left = _LETTER * max(len(each.name) for each in kept) + _GAP

    def at(value: float) -> float:
        inside = min(max(value, low), high)
        return left + (inside - low) / (high - low) * (WIDTH - left - _RIGHT)

    lines = "".join(_line(each, _TOP + LINE * k, at) for k, each in enumerate(kept))
    said = "; ".join(f"{each.name}: mean {each.mean.value:+.1f} %" for each in kept)
    return (
        f'<div class="figure"><svg class="dots" viewBox="0 0 {WIDTH:g} {height:g}" '
        'role="img" '
        f'aria-label="{text(title)}: '
        f'{text(said)}">{_axis(range(first, last + 1), step, height, at)}{lines}'
        f'<text x="{WIDTH:g}" y="{height - 12:g}" text-anchor="end">'
        f"{text(title)}</text></svg></div>"
    )


def _ticks(kept: Sequence[Comparison]) -> tuple[int, int, float]:
    """First and last tick of the axis in steps, and the step [%]: intervals lie between them whole,
    and dots but for the outermost ones.
    """
    low, high = np.percentile(np.concatenate([each.values for each in kept]), _INSIDE)
    bars = [end for each in kept for end in (each.mean.low, each.mean.high) if math.isfinite(end)]
    low = min(float(low), -1.0, *bars)
    high = max(float(high), 1.0, *bars)
    step = tick_step(_WIDER * (high - low))
    return math.floor(low / step), math.ceil(high / step), step


def _axis(ticks: range, step: float, height: float, at: Callable[[float], float]) -> str:
    found = []
    for k in ticks:
        x = at(k * step)
        kind = "zero" if k == 0 else "grid"
        bottom = height - _BOTTOM
        found.append(
            f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{_TOP:g}" y2="{bottom:g}"/>'
        )
        found.append(
            f'<text x="{x:.1f}" y="{height - 30:g}" text-anchor="middle">{_tick(k * step)} %</text>'
        )
    return "".join(found)


def _tick(percent: float) -> str:
    return f"{percent:+g}" if percent else "0"


def _line(each: Comparison, top: float, at: Callable[[float], float]) -> str:
    y = top + LINE / 2.0
    marks = "".join(
        f'<circle cx="{at(value):.1f}" '
        f'cy="{y + _SPREAD * (2.0 * (0.618034 * k % 1.0) - 1.0):.1f}" r="2"/>'
        for k, value in enumerate(each.values.tolist())
    )
    label = f'<text class="name" x="0" y="{y + 4.0:.1f}">{text(each.name)}</text>'
    if math.isnan(each.mean.low):
        return label + marks
    x = at(each.mean.low)
    wide = max(at(each.mean.high) - at(each.mean.low), 2.0)
    bar = f'<rect x="{x:.1f}" y="{y - _BAR / 2.0:.1f}" width="{wide:.1f}" height="{_BAR:g}"/>'
    return label + bar + marks
