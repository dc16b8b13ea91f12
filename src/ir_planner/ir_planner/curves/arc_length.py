"""Configurations along a path by the share of its length that lies before them."""

import numpy as np

from ir_msgs_py.arrays import FloatArray


def at_shares(path: FloatArray, shares: FloatArray) -> FloatArray:
    """Configurations (K, n) on the polyline `path` (M, n) at shares (K,) in [0, 1] of its Euclidean
    length in joint space.
    """
    passed = _lengths(path)
    return _at(path, passed, shares * passed[-1])


def evenly_spaced(path: FloatArray, count: int) -> FloatArray:
    """`count` configurations (count, n) at even distances along `path` (M, n), its ends exactly
    included.
    """
    passed = _lengths(path)
    points = _at(path, passed, np.linspace(0.0, passed[-1], count))
    points[0] = path[0]
    points[-1] = path[-1]
    return points


def _lengths(path: FloatArray) -> FloatArray:
    """Length (M,) of the path before each of its points."""
    steps = path[1:] - path[:-1]
    passed = np.zeros(len(path))
    np.cumsum(np.sqrt(np.add.reduce(steps * steps, axis=1)), out=passed[1:])
    return passed


def _at(path: FloatArray, passed: FloatArray, at: FloatArray) -> FloatArray:
    """Configurations (K, n) where lengths `at` (K,), none below 0, have been passed."""
    k = passed.searchsorted(at, side="right") - 1
    after = np.minimum(k + 1, len(path) - 1)
    length = (passed[after] - passed[k])[:, None]
    step = path[after] - path[k]
    slope = np.divide(
        step, length, out=np.zeros_like(step), where=length > 0.0
    )  # at the end there is none
    return np.asarray(slope * (at - passed[k])[:, None] + path[k])
