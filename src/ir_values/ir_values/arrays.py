"""Numbers and arrays that are checked once, where they enter, and read-only afterwards.

Finite, of the agreed shape and in range, or InvalidValueError with name, value, bound and unit.
Shapes stand in docstrings: the array types say float64, int64 or bool.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from ir_values.errors import InvalidValueError, shown

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


def as_float(value: float, name: str, unit: str = "") -> float:
    """Return the value as a float; refuse what is no number."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        suffix = f" of {unit}" if unit else ""
        raise InvalidValueError(f"{name} is {shown(value)}: it must be a number{suffix}") from error


def finite(value: float, name: str, unit: str = "") -> float:
    """Return the value as a float; refuse NaN and infinities."""
    number = as_float(value, name, unit)
    if not math.isfinite(number):
        raise InvalidValueError(f"{name} is {number}{_spaced(unit)}: it must be finite")
    return number


def not_nan(value: float, name: str, unit: str = "") -> float:
    """Return the value as a float; infinities stay (no pair of bodies: the clearance is infinite).
    Raises InvalidValueError for nan.
    """
    number = as_float(value, name, unit)
    if math.isnan(number):
        raise InvalidValueError(f"{name} is nan{_spaced(unit)}: it must be a number")
    return number


def at_least(value: float, bound: float, name: str, unit: str = "") -> float:
    """Return the value as a float; refuse what is below the bound or not finite."""
    number = finite(value, name, unit)
    if number < bound:
        raise InvalidValueError(
            f"{name} is {number:g}{_spaced(unit)}: it must be at least {bound:g}{_spaced(unit)}"
        )
    return number


def in_fraction(value: float, name: str) -> float:
    """Return the value as a float; refuse what is outside (0, 1]."""
    number = finite(value, name)
    if not 0.0 < number <= 1.0:
        raise InvalidValueError(f"{name} is {number:g}: it must be in (0, 1]")
    return number


def one_of(value: str, known: Collection[str], name: str) -> str:
    """Return the choice; an unknown one lists the known. Raises InvalidValueError for that."""
    if not isinstance(value, str) or value not in known:
        raise InvalidValueError(f'{name} is "{str(value)[:80]}": known are {", ".join(known)}')
    return value


def as_array(value: ArrayLike, name: str) -> FloatArray:
    """Return the value as an array of floats; refuse what is none."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidValueError(f"{name} must be an array of numbers: {error}") from error


def read_only(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Return a read-only float64 copy of the array; (None, 3) stands for any (N, 3).

    A copy that is already read-only float64 and owns its data is passed on as it is. Raises
    InvalidValueError for another shape and for what is not finite.
    """
    array = as_array(value, name)
    if array.ndim != len(shape) or any(
        want is not None and have != want for have, want in zip(array.shape, shape, strict=True)
    ):
        raise InvalidValueError(f"{name} has shape {array.shape}: it must be {_shape_text(shape)}")
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InvalidValueError(f"{name}{list(index)} is {array[index]}: it must be finite")
    if array.flags.writeable or array.base is not None:
        array = array.copy()
        array.flags.writeable = False
    return array


def direction(value: Sequence[float], name: str) -> tuple[float, float, float]:
    """Return a direction in space at length 1; refuse what has no three finite numbers, or no
    length.
    """
    if len(value) != 3:
        raise InvalidValueError(f"{name} has {len(value)} numbers: it must have 3, x, y and z")
    x, y, z = (finite(number, name) for number in value)
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        raise InvalidValueError(f"{name} is [0, 0, 0]: it must have a length")
    x, y, z = x / largest, y / largest, z / largest
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def set_field(value: object, name: str, content: object) -> None:
    """Store the checked content of a field of a frozen dataclass, in its __post_init__."""
    object.__setattr__(value, name, content)


def _spaced(unit: str) -> str:
    return f" {unit}" if unit else ""


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("any" if want is None else str(want) for want in shape) + ")"


ROTATION_TOLERANCE = 1e-9
"""Largest entry of R R^T - 1 that still counts as a rotation."""


def frozen(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> FloatArray:
    """Return a read-only float64 copy of that shape, (None, 3) for (N, 3), refusing NaN and
    infinity. Raises InvalidValueError for another.
    """
    array = np.array(as_array(value, name))
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
    """Return value as a float, refusing NaN and what lies outside [low, high] (or (low, high]).
    Raises InvalidValueError for these.
    """
    number = as_float(value, name, unit)
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


def number_of(text: str) -> float:
    """The number that a text is in files of others; ValueError for what only Python takes for one:
    1_000, or digits of other scripts.
    """
    if not text.isascii() or "_" in text:
        raise ValueError(f"{text[:40]!a} is no number")
    return float(text)
