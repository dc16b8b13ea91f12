"""Stacked bars of joules per movement and joint, as SVG.

What goes in is stacked to the right; what braking axes give back leads from its end to the left, so that
the thin bar ends at what the mains gave (but for what stays in the capacitors).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_recorder.analysis import StepResult
from ir_recorder.report.words import joules, text

# the drawing in units of the view box: as many pixels where the page has its full width
WIDTH = 1080
LABEL = 262  # fits LABEL_CHARACTERS
LABEL_CHARACTERS = 38
VALUE = 120  # fits "123.4 kJ" and a gap
ROW = 34
BAR = 21
BACK = 6  # height of what is given back
TOP = 26  # of the axis


def joule_bars(results: Sequence[StepResult]) -> str:
    """One bar per movement: base load, joints (signed, at the DC bus), brake resistor; a line marks the
    plan.
    """
    if not results:
        return '<p class="empty">No movements were recorded.</p>'
    pieces = [_pieces(result) for result in results]
    planned = [result.step.movement.report.energy for result in results]
    high = max(max(sum(v for _, _, v in own if v > 0) for own in pieces), max(planned), 1.0)
    scale = (WIDTH - LABEL - VALUE) / high
    height = TOP + ROW * len(results) + 8
    rows = [_axis(high, scale, height)]
    for k, (result, own, plan) in enumerate(zip(results, pieces, planned, strict=True)):
        rows.append(_row(result, own, plan, TOP + k * ROW, scale))
    return (
        f'<svg class="bars" viewBox="0 0 {WIDTH} {height}" role="img" '
        f'aria-label="Joules per movement and joint">{"".join(rows)}</svg>'
    )


def _pieces(result: StepResult) -> list[tuple[str, str, float]]:
    """(class, what, joules) of one bar."""
    own = [("base", "controller, drives and tool", result.base_energy)]
    own += [(f"a{j + 1}", f"axis A{j + 1}", float(value)) for j, value in enumerate(result.joint_energy)]
    own.append(("dissipated", "brake resistor", result.dissipated_energy))
    return [piece for piece in own if np.isfinite(piece[2])]


def _row(result: StepResult, own: list[tuple[str, str, float]], plan: float, y: float, scale: float) -> str:
    label = f"{result.step.index + 1}  {result.step.label}"
    shown = label if len(label) <= LABEL_CHARACTERS else label[: LABEL_CHARACTERS - 1] + "…"
    out = [f'<text class="label" x="{LABEL - 12}" y="{y + BAR * 0.72:.1f}">{text(shown)}</text>']
    x = float(LABEL)
    tall = BAR - BACK - 1 if any(value < 0 for _, _, value in own) else BAR
    for kind, what, value in [piece for piece in own if piece[2] > 0]:
        out.append(_piece(kind, f"{label}: {what} {joules(value)}", x, y, value * scale, tall))
        x += value * scale
    end = x
    for kind, what, value in [piece for piece in own if piece[2] < 0]:
        x += value * scale
        words = f"{label}: {what} gives back {joules(-value)}"
        out.append(_piece(kind, words, x, y + BAR - BACK, -value * scale, BACK))
    mark = LABEL + plan * scale
    out.append(
        f'<line class="plan" x1="{mark:.2f}" x2="{mark:.2f}" y1="{y - 4}" y2="{y + BAR + 4}">'
        f"<title>planned {text(joules(plan))}</title></line>"
    )
    total = text(joules(result.energy))
    out.append(f'<text class="value" x="{max(end, mark) + 8:.1f}" y="{y + BAR * 0.72:.1f}">{total}</text>')
    return "".join(out)


def _piece(kind: str, words: str, x: float, y: float, width: float, height: float) -> str:
    return (
        f'<rect class="piece {kind}" x="{x:.2f}" y="{y:.1f}" width="{max(width, 0.1):.2f}" height="{height}">'
        f"<title>{text(words)}</title></rect>"
    )


def _axis(high: float, scale: float, height: float) -> str:
    step = _tick_step(high)
    out = []
    for k in range(int(high / step) + 1):
        x = LABEL + k * step * scale
        kind = "grid" if k else "zero"
        out.append(f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - 8}" y2="{height - 4}"/>')
        out.append(f'<text class="tick" x="{x:.1f}" y="{TOP - 13}">{text(joules(k * step))}</text>')
    return "".join(out)


def _tick_step(span: float) -> float:
    raw = span / 6.0
    power = 10.0 ** np.floor(np.log10(raw))
    return float(next(power * m for m in (1, 2, 5, 10) if power * m >= raw))
