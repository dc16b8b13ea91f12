"""Bars below each other over one axis: what a whole is made of, its 90 % interval as a whisker, and
the figure beside it.

They are boxes of the page, so that their words wrap, and keep their size on a telephone and on
paper.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ir_recorder.analysis import StepResult
from ir_recorder.report.number_text import joules, text

TICKS = 5  # of an axis, about: labels of "12.3 kJ" stay apart on a telephone


@dataclass(frozen=True)
class Piece:
    """A part of a bar: the class of its colour, its words, and its value; a negative one stands
    left of zero.
    """

    style: str
    name: str
    value: float


@dataclass(frozen=True)
class Mark:
    """A mark on a bar: the class of its shape, its words, and where it stands."""

    style: str
    name: str
    value: float


@dataclass(frozen=True)
class Row:
    """A bar with its label, and beside it its figure with smaller lines. whisker: the ends of its
    interval, which may be nan.
    """

    label: str
    pieces: tuple[Piece, ...]
    value: str
    notes: tuple[str, ...] = ()
    marks: tuple[Mark, ...] = ()
    whisker: tuple[float, float] = (math.nan, math.nan)

    @property
    def taken(self) -> float:
        """The sum right of zero."""
        return sum(piece.value for piece in self.pieces if piece.value > 0.0)

    @property
    def given(self) -> float:
        """The sum left of zero."""
        return sum(piece.value for piece in self.pieces if piece.value < 0.0)

    @property
    def farthest(self) -> float:
        """What lies farthest to the right."""
        ends = [self.taken, *(mark.value for mark in self.marks), *self.whisker]
        return max(end for end in ends if math.isfinite(end))

    @property
    def leftmost(self) -> float:
        """What lies farthest to the left, at most zero."""
        ends = [self.given, *(mark.value for mark in self.marks), *self.whisker]
        return min(0.0, *(end for end in ends if math.isfinite(end)))


@dataclass(frozen=True)
class _Scale:
    """From values to percent of the track's width."""

    low: float
    high: float

    def at(self, value: float) -> float:
        return 100.0 * (value - self.low) / (self.high - self.low)


def bars(rows: Sequence[Row], name: str, axis: Callable[[float], str] | None = None) -> str:
    """The bars, called `name` where they are written as a drawing; with an axis whose values are
    shown so.
    """
    scale = _Scale(min(row.leftmost for row in rows), max(1e-9, *(row.farthest for row in rows)))
    drawn = "".join(_row(row, scale) for row in rows)
    head = _axis(scale, axis) if axis is not None else ""
    return f'<div class="bars" data-name="{text(name)}">{head}{drawn}</div>'


def _row(row: Row, scale: _Scale) -> str:
    track = [_drawn(piece, start, scale) for piece, start in _stacked(row.pieces)]
    track.append(_mark(Mark("zero", "zero", 0.0), scale))
    track += [_mark(mark, scale) for mark in row.marks if math.isfinite(mark.value)]
    low, high = row.whisker
    if low < high:
        place = _place(scale, low, high)
        track.append(f'<i class="whisker" style="{place}" title="90 % interval"></i>')
    small = "".join(f"<small>{text(note)}</small>" for note in row.notes if note)
    return (
        f'<div class="row"><span class="label">{text(row.label)}</span>'
        f'<div class="track">{"".join(track)}</div>'
        f'<span class="value"><b>{text(row.value)}</b>{small}</span></div>'
    )


def _stacked(pieces: Sequence[Piece]) -> list[tuple[Piece, float]]:
    """Each piece with the value at its left end."""
    placed = []
    right = 0.0
    left = 0.0
    for piece in pieces:
        if piece.value >= 0.0:
            placed.append((piece, right))
            right += piece.value
        else:
            left += piece.value
            placed.append((piece, left))
    return placed


def _place(scale: _Scale, low: float, high: float) -> str:
    return f"left:{scale.at(low):.2f}%;width:{scale.at(high) - scale.at(low):.2f}%"


def _drawn(piece: Piece, start: float, scale: _Scale) -> str:
    place = _place(scale, start, start + abs(piece.value))
    return f'<i class="piece {piece.style}" style="{place}" title="{text(piece.name)}"></i>'


def _mark(mark: Mark, scale: _Scale) -> str:
    place = f"left:{scale.at(mark.value):.2f}%"
    return f'<i class="{mark.style}" style="{place}" title="{text(mark.name)}"></i>'


def _axis(scale: _Scale, show: Callable[[float], str]) -> str:
    step = tick_step(scale.high - scale.low)
    first = int(np.ceil(scale.low / step))
    last = int(scale.high / step)
    ticks = [
        f'<span style="left:{scale.at(k * step):.2f}%">{text(show(k * step))}</span>'
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


# Joules of each movement: what consumers took right of zero, what braking axes gave left of it.
#
# Every piece is the net energy of one consumer over the movement. The sum of both sides is what the
# mains gave, but for what stays in the capacitors; it stands beside the bar.


def joule_bars(results: Sequence[StepResult], axes: Sequence[str]) -> str:
    """One bar per movement; a line marks the plan, a diamond what the mains gave. axes: labels of
    the joints.
    """
    if not results:
        return '<p class="empty">No movements were recorded.</p>'
    return bars([_movement(result, axes) for result in results], "energy of each movement", joules)


def _movement(result: StepResult, axes: Sequence[str]) -> Row:
    plan = result.step.movement.report.energy
    row = Row(
        f"{result.step.index + 1} {result.step.label}",
        _consumers(result, axes),
        joules(result.energy),
        marks=(
            Mark("plan", f"predicted {joules(plan)}", plan),
            Mark("net", f"at the mains {joules(result.energy)}", result.energy),
        ),
    )
    if not row.pieces:
        return row
    sides = f"{joules(row.taken)} taken, {joules(-row.given)} returned"
    return Row(row.label, row.pieces, row.value, (sides,), row.marks)


def _consumers(result: StepResult, axes: Sequence[str]) -> tuple[Piece, ...]:
    own = [("base", "controller, drives and tool", result.base_energy)]
    energies = zip(axes, result.joint_energy, strict=False)  # none of a file without joints
    own += [(label.lower(), f"axis {label}", float(joules)) for label, joules in energies]
    own.append(("dissipated", "brake resistor", result.dissipated_energy))
    return tuple(
        Piece(style, f"{name} {'takes' if value >= 0.0 else 'returns'} {joules(abs(value))}", value)
        for style, name, value in own
        if np.isfinite(value)
    )
