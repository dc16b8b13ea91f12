"""Arrays at the door of the kernels: float64, C-contiguous, right shape, not empty, finite; the
message names them.
"""

from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled
from ir_kernels.errors import KernelError
from ir_values.arrays import FloatArray

FLOAT64 = np.dtype(np.float64)


def shaped(name: str, value: ArrayLike, *shape: int | None) -> FloatArray:
    """`value` as a C-contiguous float64 array of that shape; values are not looked at.

    None in the shape is any length but 0: (None, 3) for (N, 3).

    Lists and integers are converted. An array that is not contiguous is refused rather than copied
    behind the caller's back.
    """
    if (
        type(value) is np.ndarray
        and value.dtype == FLOAT64
        and value.flags.c_contiguous
        and value.size
    ):
        got = value.shape  # the usual cases first: a driver comes here thousands of times a second
        if got == shape or (
            len(got) == 2 == len(shape) and shape[0] is None and got[1] == shape[1]
        ):
            return value
    if isinstance(value, np.ndarray) and not value.flags.c_contiguous:
        raise KernelError(
            f"{name} is not C-contiguous (strides {value.strides}): pass np.ascontiguousarray of it"
        )
    try:
        raw = np.asarray(value)
    except ValueError as error:
        raise KernelError(f"{name} is not an array of numbers: {error}") from error
    if raw.dtype.kind not in "fiu":
        raise KernelError(f"{name} has dtype {raw.dtype}, expected float64")
    array: FloatArray = np.asarray(raw, dtype=np.float64)
    wanted = tuple("N" if length is None else length for length in shape)
    if array.ndim != len(shape) or any(
        w is not None and w != g for w, g in zip(shape, array.shape, strict=True)
    ):
        raise KernelError(f"{name} has shape {array.shape}, expected {wanted}")
    if array.size == 0:
        raise KernelError(f"{name} is empty: its shape is {array.shape}")
    return array


def _all_finite(array: FloatArray) -> bool:
    return bool(
        np.isfinite(array).all() if compiled.MODULE is None else compiled.MODULE.all_finite(array)
    )


def finite(name: str, array: FloatArray) -> FloatArray:
    """`array` of any shape, (n,) or (N, n), or KernelError that says where it is not finite."""
    if not _all_finite(array):
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise KernelError(f"{name}{where} is {array[tuple(where)]}: it has to be finite")
    return array


def checked(name: str, value: ArrayLike, *shape: int | None) -> FloatArray:
    """`shaped` and `finite`: (None, 3) for (N, 3)."""
    return finite(name, shaped(name, value, *shape))


def same_length(**arrays: FloatArray) -> None:
    """Raise KernelError when batches that belong together have different lengths."""
    lengths = {name: len(array) for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{name} has {length}" for name, length in lengths.items())
        raise KernelError(f"batches of different length: {said}")


def number(
    name: str, value: SupportsFloat, least: float, most: float = np.inf, *, above: bool = False
) -> float:
    """`value` as a finite float within least and most, not least itself where `above`; or
    KernelError.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    fits = np.isfinite(number) and least <= number <= most and not (above and number == least)
    if not fits:
        bound = f"{'above' if above else 'at least'} {least:g}" + (
            f" and at most {most:g}" if most < np.inf else ""
        )
        raise KernelError(f"{name} is {value!r}: expected a finite number {bound}")
    return number
