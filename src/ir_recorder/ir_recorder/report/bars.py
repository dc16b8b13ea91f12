"""Bars of joules per movement: what consumers took right of zero, what braking axes gave left of
it.

Every piece is the net energy of one consumer over the movement. The sum of both sides is what the
mains gave, but for what stays in the capacitors; it stands beside the bar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_recorder.analysis import StepResult
from ir_recorder.report.words import joules, text

TICKS = 5  # of the axis, about: labels of "12.3 kJ" stay apart on a telephone


@dataclass(frozen=True)
class _Piece:
    style: str
    name: str
    joules: float


@dataclass(frozen=True)
class _Scale:
    """From joules to percent of the track's width."""

    low: float
    high: float

    def at(self, value: float) -> float:
        return 100.0 * (value - self.low) / (self.high - self.low)


def joule_bars(results: Sequence[StepResult]) -> str:
    """One bar per movement; a line marks the plan, a diamond what the mains gave."""
    if not results:
        return '<p class="empty">No movements were recorded.</p>'
    pieces = [_pieces(result) for result in results]
    ends = [_taken(own) for own in pieces] + [r.step.movement.report.energy for r in results]
    scale = _Scale(min(_given(own) for own in pieces), max(*ends, 1.0))
    rows = [_row(result, own, scale) for result, own in zip(results, pieces, strict=True)]
    return f'<div class="joules">{_axis(scale)}{"".join(rows)}</div>'


def _pieces(result: StepResult) -> list[_Piece]:
    own = [_Piece("base", "controller, drives and tool", result.base_energy)]
    own += [
        _Piece(f"a{j + 1}", f"axis A{j + 1}", float(v)) for j, v in enumerate(result.joint_energy)
    ]
    own.append(_Piece("dissipated", "brake resistor", result.dissipated_energy))
    return [piece for piece in own if np.isfinite(piece.joules)]


def _taken(pieces: Sequence[_Piece]) -> float:
    return sum(piece.joules for piece in pieces if piece.joules > 0.0)


def _given(pieces: Sequence[_Piece]) -> float:
    return sum(piece.joules for piece in pieces if piece.joules < 0.0)


def _row(result: StepResult, own: Sequence[_Piece], scale: _Scale) -> str:
    label = f"{result.step.index + 1} {result.step.label}"
    plan = result.step.movement.report.energy
    track = [_drawn(piece, start, scale) for piece, start in _stacked(own)]
    track.append(_mark("zero", 0.0, "zero", scale))
    track.append(_mark("plan", plan, f"predicted {joules(plan)}", scale))
    if np.isfinite(result.energy):
        track.append(_mark("net", result.energy, f"at the mains {joules(result.energy)}", scale))
    sides = f"{joules(_taken(own))} taken, {joules(-_given(own))} returned" if own else ""
    return (
        f'<div class="row"><span class="label">{text(label)}</span>'
        f'<div class="track">{"".join(track)}</div>'
        f'<span class="value"><b>{text(joules(result.energy))}</b><small>{text(sides)}</small></span></div>'  # noqa: E501
    )


def _stacked(own: Sequence[_Piece]) -> list[tuple[_Piece, float]]:
    """Each piece with the joules at its left end."""
    placed = []
    right = 0.0
    left = 0.0
    for piece in own:
        if piece.joules >= 0.0:
            placed.append((piece, right))
            right += piece.joules
        else:
            left += piece.joules
            placed.append((piece, left))
    return placed


def _drawn(piece: _Piece, start: float, scale: _Scale) -> str:
    width = scale.at(start + abs(piece.joules)) - scale.at(start)
    verb = "takes" if piece.joules >= 0.0 else "returns"
    words = f"{piece.name} {verb} {joules(abs(piece.joules))}"
    place = f"left:{scale.at(start):.2f}%;width:{width:.2f}%"
    return f'<i class="piece {piece.style}" style="{place}" title="{text(words)}"></i>'


def _mark(style: str, value: float, words: str, scale: _Scale) -> str:
    return f'<i class="{style}" style="left:{scale.at(value):.2f}%" title="{text(words)}"></i>'


def _axis(scale: _Scale) -> str:
    step = tick_step(scale.high - scale.low)
    first = int(np.ceil(scale.low / step))
    last = int(scale.high / step)
    ticks = [
        f'<span style="left:{scale.at(k * step):.2f}%">{text(joules(k * step))}</span>'
        for k in range(first, last + 1)
    ]
    track = f'<div class="track">{"".join(ticks)}</div>'
    return (
        f'<div class="row axis"><span class="label"></span>{track}<span class="value"></span></div>'
    )


def tick_step(span: float) -> float:
    """A round step (1, 2 or 5 times a power of ten) that divides a span into about TICKS."""
    raw = span / TICKS
    power = 10.0 ** np.floor(np.log10(raw))
    return float(next(power * m for m in (1, 2, 5, 10) if power * m >= raw))
