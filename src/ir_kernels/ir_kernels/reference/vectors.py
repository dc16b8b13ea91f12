"""Vectors and matrices as tuples of numbers, so that one recursion serves floats, complex steps and
intervals.

A "number" is anything with + - * (an array over the batch, or an `Interval` of two); a Vector is
three of them. Constants of the robot are plain floats.
"""

from typing import Any

import numpy as np

from ir_values.arrays import FloatArray

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
