"""Orientations along one part of a tool's path: turning evenly, through poses, or with the path."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ir_kernels import portable
from ir_planner.curves import RotationSpline, rotation_of, rotation_vector, turn_of
from ir_values.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


class RotationRates(NamedTuple):
    """Bounds of a rotation's derivatives along a path: first of R' [rad/m], second of R''
    [rad/m^2].

    Norms are 1 / sqrt(2) of Frobenius norms: where R turns about one axis, that of R' is the rate
    of its angle.
    """

    first: float = 0.0
    second: float = 0.0

    def then(self, other: RotationRates) -> RotationRates:
        """Of the product of two rotations."""
        return RotationRates(
            self.first + other.first, self.second + other.second + 2.0 * self.first * other.first
        )


@dataclass(frozen=True, eq=False)
class Evenly:
    """From the rotation `start` (3, 3), turning by `turn` (3,) rad (in the tool's frame) over
    `length` m.
    """

    start: FloatArray
    turn: FloatArray
    length: float

    @staticmethod
    def between(start: FloatArray, end: FloatArray, length: float) -> Evenly:
        """The shortest turn between rotations (3, 3)."""
        return Evenly(start, rotation_vector(portable.matmul(start.T, end)), length)

    def at(self, s: FloatArray) -> FloatArray:
        """Rotations (M, 3, 3) at s (M,) m."""
        if not self.turn.any():
            return np.broadcast_to(self.start, (len(s), 3, 3))
        share = np.asarray(s)[:, None] / self.length
        return portable.matmul(self.start, rotation_of(share * self.turn))

    @property
    def rates(self) -> RotationRates:
        """How fast it turns."""
        rate = float(portable.norm(self.turn)) / self.length
        return RotationRates(rate, rate * rate)


class ThroughPoses:
    """The rotation spline through rotations (N, 3, 3) at s (N,) m: its acceleration is
    continuous.
    """

    def __init__(self, s: FloatArray, rotations: FloatArray) -> None:
        self._spline = RotationSpline(s, rotations)
        self._end = float(s[-1])

    def at(self, s: FloatArray) -> FloatArray:
        """Rotations (M, 3, 3) at s (M,) m."""
        return self._spline(np.clip(s, 0.0, self._end))

    @cached_property
    def rates(self) -> RotationRates:
        """How fast it turns: in each piece R = R_k exp(v) with a cubic v, so that |R'| <= |v'| and
        |R''| <= |v''| + 3/2 |v'|^2.
        """
        cubic, square, line = self._spline.cubics[:3]
        h = np.diff(self._spline.x)[:, None]
        second = [2.0 * square, 2.0 * square + 6.0 * cubic * h]
        first = [line, line + 2.0 * square * h + 3.0 * cubic * (h * h)]
        bulge = h[:, 0] ** 2 / 8.0 * np.linalg.norm(6.0 * cubic, axis=1)
        rate = np.max([np.linalg.norm(one, axis=1) for one in first], axis=0) + bulge
        bend = np.max([np.linalg.norm(one, axis=1) for one in second], axis=0)
        return RotationRates(float(rate.max()), float((bend + 1.5 * (rate * rate)).max()))


def rates_of(angle: BSpline) -> RotationRates:
    """Of turning about one axis by a spline, by the hulls of its derivatives' control points."""
    first, second = (float(np.abs(angle.derivative(nu).c).max()) for nu in (1, 2))
    return RotationRates(first, second + first * first)


def turn_between(first: FloatArray, second: FloatArray) -> float:
    """Angle [rad] between two rotations (3, 3)."""
    return float(turn_of(portable.matmul(first.T, second)))


def about_tool(angle: FloatArray) -> FloatArray:
    """Rotations (M, 3, 3) by angles (M,) rad about the tool's axis, x."""
    c = portable.cos(angle)
    s = portable.sin(angle)
    turned = np.zeros((len(angle), 3, 3))
    turned[:, 0, 0] = 1.0
    turned[:, 1, 1] = c
    turned[:, 2, 2] = c
    turned[:, 1, 2] = -s
    turned[:, 2, 1] = s
    return turned
