"""L-BFGS (Nocedal, Updating quasi-Newton matrices with limited storage, 1980) with the bisecting line search
for weak Wolfe conditions of Lewis and Overton (Nonsmooth optimization via quasi-Newton methods, 2013).

For functions of a few hundred numbers in NumPy; descent.hpp of the compiled core is the same for its splines.
"""

from collections import deque
from collections.abc import Callable

import numpy as np
from ir_msgs_py.arrays import FloatArray

Function = Callable[[FloatArray], tuple[float, FloatArray]]
_MEMORY = 16
_TRIES = 12  # of the line search
_ENOUGH, _FLATTER = 1e-4, 0.9  # Wolfe's conditions
_PATIENCE = 10  # steps that must gain something together
_FIRST = 0.3  # largest change of a number in the first step


def descend(
    function: Function, x: FloatArray, evaluations: int, tolerance: float = 1e-5
) -> tuple[FloatArray, int]:
    """Minimise from x (N,); function: value and gradient (N,). Ends after `evaluations`, or when ten steps
    gain less than `tolerance` of the value. Returns the lowest x and how many evaluations it took.
    """
    value, gradient = function(x)
    used = 1
    history = [value]
    pairs: deque[tuple[FloatArray, FloatArray, float]] = deque(maxlen=_MEMORY)
    while used < evaluations:
        direction = -_by_inverse(gradient, pairs)
        slope = float(gradient @ direction)
        if not slope < 0.0:
            if not pairs:
                break
            pairs.clear()
            continue
        step = 1.0 if pairs else min(1.0, _FIRST / max(float(np.abs(direction).max()), 1e-12))
        low, high = 0.0, np.inf
        kept: tuple[FloatArray, float, FloatArray] | None = None
        for _ in range(_TRIES):
            if used >= evaluations:
                break
            at = x + step * direction
            there, its_gradient = function(at)
            used += 1
            if not there <= value + _ENOUGH * step * slope:
                high = step
                if kept is not None:
                    break
            else:
                kept, low = (at, there, its_gradient), step
                if float(its_gradient @ direction) >= _FLATTER * slope:
                    break
            step = 2.0 * low if np.isinf(high) else 0.5 * (low + high)
        if kept is None:
            if not pairs:
                break
            pairs.clear()
            continue
        moved, turned = kept[0] - x, kept[2] - gradient
        x, value, gradient = kept
        product = float(moved @ turned)
        if product > 1e-12 * float(np.sqrt((moved @ moved) * (turned @ turned))):
            pairs.append((moved, turned, 1.0 / product))
        history.append(value)
        if len(history) > _PATIENCE and history[-1 - _PATIENCE] - value < tolerance * abs(value):
            break
    return x, used


def _by_inverse(gradient: FloatArray, pairs: deque[tuple[FloatArray, FloatArray, float]]) -> FloatArray:
    """The gradient times the inverse of the Hessian that the steps imply."""
    result = gradient.copy()
    shares = []
    for moved, turned, inverse in reversed(pairs):
        share = float(moved @ result) * inverse
        result -= share * turned
        shares.append(share)
    if pairs:
        moved, turned, inverse = pairs[-1]
        result /= inverse * float(turned @ turned)
    for (moved, turned, inverse), share in zip(pairs, reversed(shares), strict=True):
        result += (share - float(turned @ result) * inverse) * moved
    return result
