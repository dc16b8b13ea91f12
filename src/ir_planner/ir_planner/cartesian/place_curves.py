"""Where a tool goes, as curves over their arc length: lines, arcs, splines through places."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ir_kernels import portable
from ir_values.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

STRAIGHT = 1e-6  # m: three places nearer to a line than this are no circle
_PER_PIECE = 24  # samples of a spline's speed between two of its knots
_NEWTON_STEPS = 5


class PlaceCurve(Protocol):
    """Places over the arc length s in [0, length] m."""

    @property
    def length(self) -> float:
        """m."""

    @property
    def breaks(self) -> FloatArray:
        """Arc lengths (K,) between which the curve is smooth, both ends included [m]."""

    @property
    def curvature(self) -> float:
        """A bound of it, all along [1/m]."""

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""

    def tangent(self, s: FloatArray) -> FloatArray:
        """Unit tangents (M, 3) at s (M,)."""


@dataclass(frozen=True, eq=False)
class Line:
    """From start to end, (3,) each [m]."""

    start: FloatArray
    end: FloatArray

    @cached_property
    def length(self) -> float:
        """m."""
        return float(portable.norm(self.end - self.start))

    @property
    def curvature(self) -> float:
        """0: the place moves straight on [1/m]."""
        return 0.0

    @property
    def breaks(self) -> FloatArray:
        """Both ends (2,) [m]."""
        return np.array([0.0, self.length])

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""
        return np.asarray(self.start + np.asarray(s)[:, None] * self._direction)

    def tangent(self, s: FloatArray) -> FloatArray:
        """Unit tangents (M, 3) at s (M,)."""
        return np.broadcast_to(self._direction, (len(s), 3))

    @cached_property
    def _direction(self) -> FloatArray:
        if self.length == 0.0:
            return np.zeros(3)
        return np.asarray((self.end - self.start) / self.length)


TURN_LENGTH = 0.25  # m that a rad of turning in place counts along a path


@dataclass(frozen=True, eq=False)
class Still:
    """One place (3,) [m], while the tool turns over `length` m."""

    place: FloatArray
    length: float

    @property
    def curvature(self) -> float:
        """0: the place stays [1/m]."""
        return 0.0

    @property
    def breaks(self) -> FloatArray:
        """Both ends (2,) [m]."""
        return np.array([0.0, self.length])

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""
        return np.broadcast_to(self.place, (len(s), 3))

    def tangent(self, s: FloatArray) -> FloatArray:
        """No direction: zeros (M, 3)."""
        return np.zeros((len(s), 3))


@dataclass(frozen=True, eq=False)
class Arc:
    """Places centre + cos(phi) radius + sin(phi) across, (3,) each [m], for phi from 0 to angle
    [rad].
    """

    centre: FloatArray
    radius: FloatArray
    across: FloatArray
    angle: float

    @cached_property
    def length(self) -> float:
        """m."""
        return abs(self.angle) * float(portable.norm(self.radius))

    @property
    def curvature(self) -> float:
        """That of the circle, all along [1/m]."""
        return 1.0 / float(portable.norm(self.radius))

    @property
    def breaks(self) -> FloatArray:
        """Both ends (2,) [m]."""
        return np.array([0.0, self.length])

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""
        turned = np.asarray(s)[:, None] * self._rate
        return np.asarray(
            self.centre + portable.cos(turned) * self.radius + portable.sin(turned) * self.across
        )

    def tangent(self, s: FloatArray) -> FloatArray:
        """Unit tangents (M, 3) at s (M,)."""
        turned = np.asarray(s)[:, None] * self._rate
        return np.asarray(
            (portable.cos(turned) * self.across - portable.sin(turned) * self.radius) * self._rate
        )

    @property
    def _rate(self) -> float:
        """rad per m."""
        return self.angle / self.length if self.length > 0.0 else 0.0


def arc_through(
    start: FloatArray, via: FloatArray, end: FloatArray, angle: float | None = None
) -> Arc | None:
    """The circle through three places (3,) [m], up to the end or to an angle [rad]; None where they
    lie on a line, or the end where the start is.
    """
    a = via - start
    b = end - start
    normal = np.cross(a, b)
    size = float(portable.matmul(normal, normal))
    nearest = min(float(portable.matmul(a, a)), float(portable.matmul(b, b)))
    if nearest < STRAIGHT * STRAIGHT or size < np.square(STRAIGHT * portable.norm(b)):
        return None
    centre = start + np.cross(
        float(portable.matmul(a, a)) * b - float(portable.matmul(b, b)) * a, normal
    ) / (2.0 * size)
    radius = start - centre
    across = np.cross(normal / np.sqrt(size), radius)
    if angle is None:
        reach = end - centre
        angle = float(
            portable.arctan2(portable.matmul(reach, across), portable.matmul(reach, radius))
        ) % (2.0 * np.pi)
    return Arc(centre, radius, across, angle)


class Through:
    """The interpolating spline through places (N, 3) m, over its own arc length: cubic, its second
    derivative is continuous.
    """

    def __init__(self, places: FloatArray) -> None:
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        u = np.concatenate([[0.0], np.cumsum(steps)])
        self._curve = portable.interpolating_spline(u, places, min(3, len(u) - 1))
        self._arc = ArcLength(np.unique(self._curve.t), self._speed)
        self.at_points = self._arc.of(u)  # arc length at each place (N,)
        self.length = self._arc.length

    @property
    def breaks(self) -> FloatArray:
        """Arc lengths (K,) of the spline's knots [m]."""
        return self._arc.of(np.unique(self._curve.t))

    @cached_property
    def curvature(self) -> float:
        """A bound of it, all along [1/m].

        It is |p''| / |p'|^2 at most. Between two samples p'' is linear, so |p''| is largest at one
        of them. |p'| is at least the smaller one of both less half of what |p''| can change it by.
        """
        u = self._arc.samples
        bent = np.linalg.norm(self._curve(u, nu=2), axis=1)
        bent = np.maximum(bent[1:], bent[:-1])
        speed = self._speed(u)
        least = np.minimum(speed[1:], speed[:-1]) - 0.5 * bent * np.diff(u)
        if least.min() <= 0.0:
            return np.inf
        return float((bent / (least * least)).max())

    def at(self, s: FloatArray) -> FloatArray:
        """Places (M, 3) m at s (M,)."""
        return np.asarray(self._curve(self._arc.inverse(s)))

    def tangent(self, s: FloatArray) -> FloatArray:
        """Unit tangents (M, 3) at s (M,)."""
        slope = self._curve(self._arc.inverse(s), nu=1)
        return np.asarray(slope / np.linalg.norm(slope, axis=1)[:, None])

    def _speed(self, u: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(self._curve(u, nu=1), axis=1))


class ArcLength:
    """Arc length over a parameter u, and back: speed(u) = |dp/du| is smooth between `breaks`
    (K,).
    """

    def __init__(self, breaks: FloatArray, speed: _Speed) -> None:
        share = np.linspace(0.0, 1.0, _PER_PIECE + 1)[:-1]
        u = (breaks[:-1, None] + share * np.diff(breaks)[:, None]).ravel()
        self._u = np.append(u, breaks[-1])
        self._speed: BSpline = portable.interpolating_spline(self._u, speed(self._u), 3)
        self._length: BSpline = self._speed.antiderivative()
        self._offset = float(self._length(breaks[0]))
        self._s = np.asarray(self._length(self._u)) - self._offset
        self.length = float(self._s[-1])

    @property
    def samples(self) -> FloatArray:
        """Parameters (M,), the breaks among them, so dense that the speed is known between."""
        return self._u

    def of(self, u: FloatArray) -> FloatArray:
        """Arc lengths (M,) m at u (M,)."""
        return np.asarray(self._length(u)) - self._offset

    def inverse(self, s: FloatArray) -> FloatArray:
        """Parameters u (M,) at arc lengths s (M,) m."""
        u = np.interp(s, self._s, self._u)
        for _ in range(_NEWTON_STEPS):
            u = np.clip(u - (self.of(u) - s) / self._speed(u), self._u[0], self._u[-1])
        return np.asarray(u)


class _Speed(Protocol):
    def __call__(self, u: FloatArray) -> FloatArray: ...
