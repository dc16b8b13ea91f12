"""Samples of motions along polynomials."""

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled, portable
from ir_kernels.arguments import checked
from ir_kernels.errors import InputError
from ir_kernels.limits import segments
from ir_kernels.reference.limits import derivative
from ir_values.arrays import FloatArray

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
    ends. Raises InputError.
    """
    c, T = segments(coefficients, durations)
    first = checked("begins", begins, len(c))
    at = checked("times", times, None)
    if (np.diff(first) <= 0.0).any():
        raise InputError("begins have to rise")
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
