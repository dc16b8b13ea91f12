"""Extremes of polynomials over an interval, found between the extremes of their derivatives.

Between two neighbouring roots of p' a polynomial p is monotonic, so it has one root there or none;
from the linear derivative upwards every bracket is safe. Where a bracket holds no root its better
end is taken: a superfluous candidate harms no extreme, and a double root is such an end.
"""

import numpy as np

from ir_values.arrays import FloatArray

ITERATIONS = 80  # of bisection at most; Newton ends after a handful


def evaluate(coefficients: FloatArray, x: FloatArray) -> FloatArray:
    """sum_k c_k x^k for coefficients (..., d+1) at x (..., m)."""
    value = coefficients[..., -1:] + 0.0 * x
    for k in reversed(range(coefficients.shape[-1] - 1)):
        value = value * x + coefficients[..., k : k + 1]
    return np.asarray(value)


def derivative(coefficients: FloatArray) -> FloatArray:
    """Coefficients (..., d) of the derivative of (..., d+1)."""
    return np.asarray(coefficients[..., 1:] * np.arange(1.0, coefficients.shape[-1]))


def _root(p: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Root of the polynomials p (..., d+1) in brackets (..., m) on which they are monotonic, or
    their better end.
    """
    slope = derivative(p)
    at_low = evaluate(p, low)
    at_high = evaluate(p, high)
    bracketed = at_low * at_high < 0.0
    x = np.where(np.abs(at_low) <= np.abs(at_high), low, high)
    x = np.where(bracketed, 0.5 * (low + high), x)
    for _ in range(ITERATIONS):
        value = evaluate(p, x)
        left = value * at_low > 0.0
        low = np.where(bracketed & left, x, low)
        high = np.where(bracketed & ~left, x, high)
        steep = evaluate(slope, x)
        newton = x - value / np.where(steep == 0.0, 1.0, steep)
        inside = (steep != 0.0) & (newton >= low) & (newton <= high)
        following = np.where(
            bracketed & (value != 0.0), np.where(inside, newton, 0.5 * (low + high)), x
        )
        if (np.abs(following - x) <= 1e-16).all():
            break
        x = following
    return x


def critical_points(coefficients: FloatArray) -> FloatArray:
    """Where p (..., d+1) can have extremes within [0, 1]: both ends and the roots of p' (...,
    d+1).
    """
    chain = [coefficients]
    while chain[-1].shape[-1] > 2:
        chain.append(derivative(chain[-1]))
    ends = np.broadcast_to(np.array([0.0, 1.0]), (*coefficients.shape[:-1], 2))
    points = ends
    for p in reversed(chain[1:]):
        roots = _root(p, points[..., :-1], points[..., 1:])
        points = np.sort(np.concatenate([ends, roots], axis=-1), axis=-1)
    return points


def polynomial_extrema(
    coefficients: FloatArray, durations: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Smallest and largest value (S, n) of p(t) = sum_k c_k t^k on [0, duration], and their
    times.
    """
    scale = durations[:, None, None] ** np.arange(coefficients.shape[2])
    scaled = coefficients * scale
    points = critical_points(scaled)
    values = evaluate(scaled, points)
    lowest = values.argmin(axis=2)[..., None]
    highest = values.argmax(axis=2)[..., None]

    def pick(array: FloatArray, index: FloatArray) -> FloatArray:
        return np.asarray(np.take_along_axis(array, index, axis=2)[..., 0])  # type: ignore[arg-type]

    times = points * durations[:, None, None]
    return pick(values, lowest), pick(values, highest), pick(times, lowest), pick(times, highest)
