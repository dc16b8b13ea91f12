"""Drawing of paired comparisons: a dot per pair, a bar for the interval of the mean."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ir_recorder.report.bars import tick_step
from ir_recorder.report.number_text import text
from ir_studies.statistics.findings import Comparison

WIDTH = 420.0  # as narrow as a telephone, so that its letters stay readable there
LINE = 46.0  # of it the upper part is for the name
_NAME = 14.0
_LEFT = 34.0
_RIGHT = 34.0
_TOP = 8.0
_BOTTOM = 48.0
_INSIDE = (2.0, 98.0)  # percentiles that the axis holds; dots outside are drawn at its edge
_SPREAD = 9.0  # up and down that dots are moved apart


def dots(comparisons: Sequence[Comparison], title: str) -> str:
    """SVG, its title below the axis; "" where nothing was compared."""
    kept = [each for each in comparisons if each.count]
    if not kept:
        return ""
    first, last, step = _ticks(kept)
    low = first * step
    high = last * step
    height = _TOP + LINE * len(kept) + _BOTTOM

    def at(value: float) -> float:
        inside = min(max(value, low), high)
        return _LEFT + (inside - low) / (high - low) * (WIDTH - _LEFT - _RIGHT)

    lines = "".join(_line(each, _TOP + LINE * k, at) for k, each in enumerate(kept))
    said = "; ".join(f"{each.name}: mean {each.mean.value:+.1f} %" for each in kept)
    return (
        f'<div class="figure"><svg class="dots" viewBox="0 0 {WIDTH:g} {height:g}" '
        'role="img" '
        f'aria-label="{text(title)}: '
        f'{text(said)}">{_axis(range(first, last + 1), step, height, at)}{lines}'
        f'<text x="{WIDTH / 2:g}" y="{height - 12:g}" text-anchor="middle">'
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
    step = tick_step(high - low)
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
    y = top + (LINE + _NAME) / 2.0
    marks = "".join(
        f'<circle cx="{at(value):.1f}" '
        f'cy="{y + _SPREAD * (2.0 * (0.618034 * k % 1.0) - 1.0):.1f}" r="2"/>'
        for k, value in enumerate(each.values.tolist())
    )
    label = f'<text class="name" x="0" y="{top + _NAME - 2:.1f}">{text(each.name)}</text>'
    if math.isnan(each.mean.low):
        return label + marks
    x = at(each.mean.low)
    wide = max(at(each.mean.high) - at(each.mean.low), 2.0)
    bar = f'<rect x="{x:.1f}" y="{y - 12:.1f}" width="{wide:.1f}" height="24"/>'
    return label + bar + marks
