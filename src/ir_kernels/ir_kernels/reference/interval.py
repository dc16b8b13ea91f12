"""Numbers for proofs: intervals that round outwards, and dual numbers that carry a derivative
along.

An Interval holds arrays of lower and upper ends; the result of an operation encloses the true
result for all points of its arguments, because every end is moved outwards by two units in the last
place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ir_values.arrays import FloatArray

# Vectors and matrices as tuples of numbers, so that one recursion serves floats, complex steps and
# intervals.
#
# A "number" is anything with + - * (an array over the batch, or an `Interval` of two); a Vector is
# three of them. Constants of the robot are plain floats.

Number = Any
Vector = tuple[Number, Number, Number]
Matrix = tuple[Vector, Vector, Vector]


def vector(constants: FloatArray) -> Vector:
    """The constants (3,) as floats."""
    x, y, z = constants.tolist()
    return x, y, z


def matrix(constants: FloatArray) -> Matrix:
    """The constants (3, 3) as rows of floats."""
    return vector(constants[0]), vector(constants[1]), vector(constants[2])


def add(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def scale(a: Vector, s: Number) -> Vector:
    """A times the number s."""
    return a[0] * s, a[1] * s, a[2] * s


def dot(a: Vector, b: Vector) -> Number:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def apply(m: Matrix, a: Vector) -> Vector:
    """Matrix times vector."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


def transpose(m: Matrix) -> Matrix:
    """Rows as columns."""
    return (m[0][0], m[1][0], m[2][0]), (m[0][1], m[1][1], m[2][1]), (m[0][2], m[1][2], m[2][2])


def joint_rotation(origin: FloatArray, axis: FloatArray, sin: Number, cos: Number) -> Matrix:
    """Rotation of the frame after a revolute joint in the frame before it (Rodrigues), entry by
    entry.

    R(q) = E (a a' + cos q (1 - a a') + sin q [a]x) with origin (4, 4), E = origin[:3, :3] and a =
    axis (3,).
    """
    E = origin[:3, :3]
    along = np.outer(axis, axis)
    skew = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    A = E @ along
    B = E @ (np.eye(3) - along)
    C = E @ skew
    rows = [tuple(cos * B[k, j] + sin * C[k, j] + A[k, j] for j in range(3)) for k in range(3)]
    return rows[0], rows[1], rows[2]


OUTWARD = 4.5e-16
TINY = 1e-140


@dataclass(frozen=True, eq=False)
class Interval:
    """Closed intervals [lo, hi], arrays of one shape."""

    lo: FloatArray
    hi: FloatArray
    __array_ufunc__ = None  # so that a NumPy number times an Interval comes here

    def __neg__(self) -> Interval:
        return Interval(-self.hi, -self.lo)

    def __add__(self, other: Number) -> Interval:
        o = interval(other)
        return outward(self.lo + o.lo, self.hi + o.hi)

    def __sub__(self, other: Number) -> Interval:
        return self + -interval(other)

    def __rsub__(self, other: Number) -> Interval:
        return interval(other) - self

    def __mul__(self, other: Number) -> Interval:
        o = interval(other)
        p = self.lo * o.lo
        q = self.lo * o.hi
        r = self.hi * o.lo
        s = self.hi * o.hi
        return outward(
            np.minimum(np.minimum(p, q), np.minimum(r, s)),
            np.maximum(np.maximum(p, q), np.maximum(r, s)),
        )

    __radd__ = __add__
    __rmul__ = __mul__


@dataclass(frozen=True, eq=False)
class Dual:
    """Value v and derivative d along one direction, both any kind of number."""

    v: Number
    d: Number
    __array_ufunc__ = None

    def __neg__(self) -> Dual:
        return Dual(-self.v, -self.d)

    def __add__(self, other: Number) -> Dual:
        return (
            Dual(self.v + other.v, self.d + other.d)
            if isinstance(other, Dual)
            else Dual(self.v + other, self.d)
        )

    def __sub__(self, other: Number) -> Dual:
        return self.__add__(-other)

    def __rsub__(self, other: Number) -> Dual:
        return (-self).__add__(other)

    def __mul__(self, other: Number) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.v * other.v, self.d * other.v + self.v * other.d)
        return Dual(self.v * other, self.d * other)

    __radd__ = __add__
    __rmul__ = __mul__


def interval(x: Number) -> Interval:
    """X itself, or the interval that holds just the number(s) x."""
    return x if isinstance(x, Interval) else Interval(np.asarray(x, float), np.asarray(x, float))


def outward(lo: FloatArray, hi: FloatArray) -> Interval:
    """[lo, hi] (N,) widened by two units in the last place."""
    return Interval(lo - (np.abs(lo) * OUTWARD + TINY), hi + (np.abs(hi) * OUTWARD + TINY))


def intersect(a: Interval, b: Interval) -> Interval:
    """What both hold."""
    return Interval(np.maximum(a.lo, b.lo), np.minimum(a.hi, b.hi))


def power(x: Number, exponent: float) -> Number:
    """X to a constant exponent for x > 0, also for dual numbers."""
    if isinstance(x, Dual):
        return Dual(power(x.v, exponent), power(x.v, exponent - 1.0) * exponent * x.d)
    ends = np.power(x.lo, exponent), np.power(x.hi, exponent)
    wide = outward(np.minimum(*ends), np.maximum(*ends))
    return outward(wide.lo, wide.hi)


def sine_cosine(x: Interval) -> tuple[Interval, Interval]:
    """Sines and cosines of all angles of x."""
    sine = (np.sin(x.lo), np.sin(x.hi))
    cosine = (np.cos(x.lo), np.cos(x.hi))
    wide = x.hi - x.lo > 3.0

    def between(
        value: tuple[FloatArray, FloatArray], slope: tuple[FloatArray, FloatArray]
    ) -> Interval:
        # a turning point within rounding of an end is no higher than the end, to rounding squared
        top = wide | ((slope[0] > 0.0) & (slope[1] < 0.0))
        bottom = wide | ((slope[0] < 0.0) & (slope[1] > 0.0))
        lo = np.where(bottom, -1.0, np.maximum(np.minimum(*value) - 1e-15, -1.0))
        return Interval(lo, np.where(top, 1.0, np.minimum(np.maximum(*value) + 1e-15, 1.0)))

    return between(sine, cosine), between(cosine, (-sine[0], -sine[1]))
