"""Exact extremes of the interpolant: how far, how fast, how hard every joint moves, between the
points as well.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled, data, portable
from ir_kernels.arguments import checked
from ir_kernels.errors import KernelError
from ir_kernels.reference import limits as reference
from ir_kernels.reference.limits import derivative
from ir_values.arrays import FloatArray

COMPILED_TERMS = 16  # of a polynomial, beyond them the reference works


class Extrema(NamedTuple):
    """Smallest and largest values of polynomials (S, n) and when they are taken, s from the start
    of the segment.
    """

    minimum: FloatArray
    maximum: FloatArray
    time_of_minimum: FloatArray
    time_of_maximum: FloatArray


def segments(coefficients: ArrayLike, durations: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Coefficients (S, n, d + 1) and durations (S,) checked, or KernelError."""
    c = checked("coefficients", coefficients, None, None, None)
    T = checked("durations", durations, len(c))
    if (T <= 0.0).any():
        raise KernelError(
            f"durations[{int(T.argmin())}] is {T.min()} s: segments have to be longer than 0"
        )
    return c, T


def polynomial_extrema(
    coefficients: ArrayLike,
    durations: ArrayLike,
    derivative: int = 0,
    *,
    core: compiled.Core = compiled.MODULE,
) -> Extrema:
    """Extremes of the `derivative`-th derivative of q(t) = sum_k c_k t^k, t in [0, duration], to
    rounding.

    coefficients (S, n, d + 1), durations (S,) s. Raises KernelError.
    """
    c, T = segments(coefficients, durations)
    if derivative < 0:
        raise KernelError(f"derivative is {derivative}: it has to be 0 or more")
    for _ in range(derivative):
        c = reference.derivative(c) if c.shape[2] > 1 else 0.0 * c
    if core is None or not hasattr(core, "polynomial_extrema") or c.shape[2] > COMPILED_TERMS:
        result = reference.polynomial_extrema(c, T)
    else:
        result = core.polynomial_extrema(c, T)
    return Extrema(*(data.read_only(array) for array in result))


# Samples of motions along polynomials.

Motion = tuple[FloatArray, FloatArray, FloatArray]  # q, qd, qdd, each (M, n)


def polynomial_samples(
    coefficients: ArrayLike,
    durations: ArrayLike,
    begins: ArrayLike,
    times: ArrayLike,
    *,
    core: compiled.Core = compiled.MODULE,
) -> Motion:
    """q, qd, qdd (M, n) at times (M,) s of q(t) = sum_k c_k t^k, coefficients (S, n, d + 1), t from
    the beginning of each segment; begins (S,) s rise, durations (S,) s.

    At a time that two segments share the later one counts; times before and after are those of the
    ends. Raises KernelError.
    """
    c, T = segments(coefficients, durations)
    first = checked("begins", begins, len(c))
    at = checked("times", times, None)
    if (np.diff(first) <= 0.0).any():
        raise KernelError("begins have to rise")
    if core is not None and hasattr(core, "polynomial_samples"):
        found: Motion = core.polynomial_samples(c, T, first, at)
        return found
    k = np.clip(np.searchsorted(first, at, side="right") - 1, 0, len(T) - 1)
    local = np.clip(at - first[k], 0.0, T[k])
    speed = derivative(c)
    return _at(c[k], local), _at(speed[k], local), _at(derivative(speed)[k], local)


def _at(c: FloatArray, t: FloatArray) -> FloatArray:
    """Values (M, n) of polynomials (M, n, K) at times (M,)."""
    powers = portable.power(t[:, None, None], np.arange(c.shape[2]))
    values: FloatArray = (c * powers).sum(axis=2)
    return values
