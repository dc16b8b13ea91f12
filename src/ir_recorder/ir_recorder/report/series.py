"""Series small enough for a page: envelopes of long ones, and numbers packed into base64."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ir_msgs_py.arrays import FloatArray

Json: TypeAlias = "Mapping[str, Json] | Sequence[Json] | str | float | bool | None"


@dataclass(frozen=True, eq=False)
class Envelope:
    """Lowest and highest value per stretch: time (M,) of its middle, low (M,), high (M,)."""

    time: FloatArray
    low: FloatArray
    high: FloatArray


def envelope(time: FloatArray, value: FloatArray, most: int) -> Envelope:
    """A series (N,) as at most `most` stretches of equal count, every peak kept; a short one
    unchanged.
    """
    if len(time) <= most:
        return Envelope(time, value, value)
    edges = np.linspace(0, len(time), most + 1).astype(int)[:-1]
    low = np.minimum.reduceat(value, edges)
    high = np.maximum.reduceat(value, edges)
    first = time[edges]
    last = time[np.append(edges[1:], len(time)) - 1]
    return Envelope((first + last) / 2.0, low, high)


def floats(values: ArrayLike) -> str:
    """An array of any shape (...) as float32, little endian, in base64."""
    return _base64(np.asarray(values, dtype="<f4"))


def quantised(values: ArrayLike, step: float) -> str:
    """An array (...) as int16 multiples of `step`, little endian, in base64; clipped to its
    range.
    """
    kept = np.clip(np.nan_to_num(np.asarray(values, dtype=float)), -32768 * step, 32767 * step)
    return _base64(np.rint(kept / step).astype("<i2"))


def indices(values: ArrayLike) -> str:
    """An array (...) of indices as uint16, little endian, in base64."""
    return _base64(np.asarray(values, dtype="<u2"))


def _base64(array: NDArray[np.generic]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
