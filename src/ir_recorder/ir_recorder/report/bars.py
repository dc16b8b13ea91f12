"""Stacked bars of joules per movement and joint, as SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_recorder.analysis import StepResult
from ir_recorder.report.words import joules, text

WIDTH = 1080
LABEL = 230
VALUE = 120
ROW = 34
BAR = 20
TOP = 26


def joule_bars(results: Sequence[StepResult]) -> str:
    """One bar per movement: base load, joints (signed, at the DC bus), brake resistor; a line marks the
    plan.
    """
    if not results:
        return '<p class="empty">No movements were recorded.</p>'
    pieces = [_pieces(result) for result in results]
    planned = [result.step.movement.report.energy for result in results]
    high = max(max(sum(v for _, _, v in own if v > 0) for own in pieces), max(planned), 1.0)
    low = min(min(sum(v for _, _, v in own if v < 0) for own in pieces), 0.0)
    scale = (WIDTH - LABEL - VALUE) / (high - low)
    zero = LABEL - low * scale
    height = TOP + ROW * len(results) + 8
    rows = [_axis(low, high, zero, scale, height)]
    for k, (result, own, plan) in enumerate(zip(results, pieces, planned, strict=True)):
        rows.append(_row(result, own, plan, TOP + k * ROW, zero, scale))
    return (
        f'<svg class="bars" viewBox="0 0 {WIDTH} {height}" role="img" '
        f'aria-label="Joules per movement and joint">{"".join(rows)}</svg>'
    )


def _pieces(result: StepResult) -> list[tuple[str, str, float]]:
    """(class, what, joules) of one bar."""
    own = [("base", "controller, drives and tool", result.base_energy)]
    own += [(f"a{j + 1}", f"axis A{j + 1}", float(value)) for j, value in enumerate(result.joint_energy)]
    own.append(("burnt", "brake resistor", result.burnt_energy))
    return [piece for piece in own if np.isfinite(piece[2])]


def _row(
    result: StepResult, own: list[tuple[str, str, float]], plan: float, y: float, zero: float, scale: float
) -> str:
    label = f"{result.step.index + 1}  {result.step.label}"
    out = [
        f'<text class="label" x="{LABEL - 12}" y="{y + BAR * 0.72:.1f}">'
        f"{text(label if len(label) <= 34 else label[:33] + '…')}</text>"
    ]
    right, left = zero, zero
    for kind, what, value in own:
        width = abs(value) * scale
        if width < 0.05:
            continue
        x = right if value > 0 else left - width
        right, left = (right + width, left) if value > 0 else (right, left - width)
        out.append(
            f'<rect class="piece {kind}" x="{x:.2f}" y="{y}" width="{width:.2f}" height="{BAR}">'
            f"<title>{text(label)}: {text(what)} {text(joules(value))}</title></rect>"
        )
    mark = zero + plan * scale
    out.append(
        f'<line class="plan" x1="{mark:.2f}" x2="{mark:.2f}" y1="{y - 4}" y2="{y + BAR + 4}">'
        f"<title>planned {text(joules(plan))}</title></line>"
    )
    end = max(right, mark) + 8
    out.append(
        f'<text class="value" x="{end:.1f}" y="{y + BAR * 0.72:.1f}">{text(joules(result.energy))}</text>'
    )
    return "".join(out)


def _axis(low: float, high: float, zero: float, scale: float, height: float) -> str:
    step = _tick_step(high - low)
    out = []
    for k in range(int(np.floor(low / step)), int(np.ceil(high / step)) + 1):
        value = k * step
        if low <= value <= high:
            x = zero + value * scale
            kind = "zero" if k == 0 else "grid"
            out.append(f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - 8}" y2="{height - 4}"/>')
            out.append(f'<text class="tick" x="{x:.1f}" y="{TOP - 13}">{text(joules(value))}</text>')
    return "".join(out)


def _tick_step(span: float) -> float:
    raw = span / 6.0
    power = 10.0 ** np.floor(np.log10(raw))
    return float(next(power * m for m in (1, 2, 5, 10) if power * m >= raw))
