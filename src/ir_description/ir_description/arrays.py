"""Arrays that are checked once and then read-only.

Every value type of this package passes its arrays through here: float64, the agreed shape, finite,
not writable.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

ROTATION_TOLERANCE = 1e-9
"""Largest entry of R R^T - 1 that still counts as a rotation."""


def frozen(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> FloatArray:
    """Return a read-only float64 copy of that shape, (None, 3) for (N, 3), refusing NaN and
    infinity.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"{name} must be an array of numbers") from error
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(want not in (None, got) for want, got in zip(shape, array.shape, strict=True))
    ):
        wanted = tuple("N" if s is None else s for s in shape)
        raise InvalidValueError(f"{name} has shape {array.shape}, must be {wanted}")
    # a finite sum is soon known and has finite terms; finite terms may have an infinite sum
    if not math.isfinite(array.sum()) and not np.isfinite(array).all():
        raise InvalidValueError(f"{name} has entries that are not finite")
    array.setflags(write=False)
    return array


def frozen_pose(value: ArrayLike, name: str) -> FloatArray:
    """Return a read-only (4, 4) rigid motion, refusing what is not one."""
    pose = frozen(value, (4, 4), name)
    if not _is_rigid(pose.tolist()):
        raise InvalidValueError(
            f"{name} is not a pose: its rotation must be orthonormal and right-handed"
        )
    return pose


def _is_rigid(rows: list[list[float]]) -> bool:
    """Whether four rows are those of a rigid motion; in plain floats, a fifth of the time of
    NumPy's.
    """
    (a, b, c, _), (d, e, f, _), (g, h, i, _), last = rows
    within = (
        abs(error) <= ROTATION_TOLERANCE
        for error in (
            a * a + b * b + c * c - 1.0,
            d * d + e * e + f * f - 1.0,
            g * g + h * h + i * i - 1.0,
            a * d + b * e + c * f,
            a * g + b * h + c * i,
            d * g + e * h + f * i,
        )
    )
    right_handed = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0
    return all(within) and right_handed and last == [0.0, 0.0, 0.0, 1.0]


NEEDLE = 1e-12
"""Least principal moment of inertia over the largest: a rod of 1 m, a thousandth of a millimetre
thick.
"""


def frozen_inertia(value: ArrayLike, name: str) -> FloatArray:
    """Return a read-only (3, 3) inertia [kg m^2], refusing what no body can have.

    A body's inertia is symmetric and positive definite, and its principal moments satisfy the
    triangle inequality (each is at most the sum of the other two). What only rounding keeps
    positive is refused too: scaled or turned it would be none.
    """
    inertia = frozen(value, (3, 3), name)
    if np.abs(inertia - inertia.T).max() > 1e-12 * max(1.0, float(np.abs(inertia).max())):
        raise InvalidValueError(f"{name} is not symmetric")
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= NEEDLE * moments[2]:
        least = NEEDLE * moments[2] if moments[0] > 0.0 else 0.0
        raise InvalidValueError(
            f"{name} has a principal moment of {moments[0]:.4g} kg m^2, must be above {least:.2g}"
        )
    if moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        raise InvalidValueError(
            f"{name} breaks the triangle inequality: principal moment {moments[2]:.4g} kg m^2 is "
            f"above {moments[0] + moments[1]:.4g} kg m^2, the sum of the other two"
        )
    return inertia


def in_range(
    value: float, low: float, high: float, unit: str, name: str, *, open_low: bool = False
) -> float:
    """Return value as a float, refusing NaN and what lies outside [low, high] (or (low, high])."""
    number = float(value)
    if not (low < number <= high if open_low else low <= number <= high):
        left = "(" if open_low else "["
        raise InvalidValueError(
            f"{name} is {number:g} {unit}, must be in {left}{low:g}, {high:g}] {unit}".strip()
        )
    return number


def solid_box_inertia(mass: float, size: ArrayLike) -> FloatArray:
    """Return the inertia (3, 3) [kg m^2] of a solid box about its centre: mass [kg], full size (3,)
    [m].
    """
    x, y, z = frozen(size, (3,), "size") ** 2
    return frozen(np.diag([y + z, x + z, x + y]) * (mass / 12.0), (3, 3), "inertia")


def transformed(pose: FloatArray, points: FloatArray) -> FloatArray:
    """Return the points (N, 3) or (3,) moved by a pose (4, 4)."""
    moved: FloatArray = portable.matmul(points, pose[:3, :3].T) + pose[:3, 3]
    return moved
