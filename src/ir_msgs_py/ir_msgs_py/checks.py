"""Values are checked once, at the door: finite, of the right shape, and read-only afterwards."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError


def finite(value: float, name: str, unit: str = "") -> float:
    """Return the value as a float; refuse NaN and infinities."""
    number = float(value)
    if not math.isfinite(number):
        raise InvalidValueError(f"{name} is {number}{_spaced(unit)}: it must be finite")
    return number


def not_nan(value: float, name: str, unit: str = "") -> float:
    """Return the value as a float; infinities stay (no pair of bodies: the clearance is
    infinite).
    """
    number = float(value)
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
    """Return the choice; an unknown one lists the known."""
    if value not in known:
        raise InvalidValueError(f'{name} is "{value[:80]}": known are {", ".join(known)}')
    return value


def read_only(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Return a read-only float64 copy of the array; (None, 3) stands for any (N, 3).

    A copy that is already read-only float64 and owns its data is passed on as it is.
    """
    array: FloatArray = np.asarray(value, dtype=np.float64)
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


def set_field(value: object, name: str, content: object) -> None:
    """Store the checked content of a field of a frozen dataclass, in its __post_init__."""
    object.__setattr__(value, name, content)


def _spaced(unit: str) -> str:
    return f" {unit}" if unit else ""


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("any" if want is None else str(want) for want in shape) + ")"


SENTENCE_MAX = 4000  # characters: the longest sentence of the project's own has about 1,500


def one_line(text: str, limit: int = SENTENCE_MAX) -> str:
    """The text as it may stand in answers, logs and diagnostics: one line, bounded, every control
    character and lone surrogate escaped.
    """
    safe = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[: limit + 1])
    return safe if len(safe) <= limit else f"{safe[: limit - 3]}..."
