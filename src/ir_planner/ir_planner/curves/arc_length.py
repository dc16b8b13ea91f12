"""Configurations along a path by the share of its length that lies before them."""

import numpy as np

from ir_msgs_py.arrays import FloatArray


def at_shares(path: FloatArray, shares: FloatArray) -> FloatArray:
    """Configurations (K, n) on the polyline `path` (M, n) at shares (K,) in [0, 1] of its Euclidean length in
    joint space.
    """
    passed = _lengths(path)
    return _at(path, passed, shares * passed[-1])


def evenly_spaced(path: FloatArray, count: int) -> FloatArray:
    """`count` configurations (count, n) at even distances along `path` (M, n), its ends exactly included."""
    passed = _lengths(path)
    points = _at(path, passed, np.linspace(0.0, passed[-1], count))
    points[0], points[-1] = path[0], path[-1]
    return points


def _lengths(path: FloatArray) -> FloatArray:
    """Length (M,) of the path before each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])


def _at(path: FloatArray, passed: FloatArray, at: FloatArray) -> FloatArray:
    """Configurations (K, n) where lengths `at` (K,) have been passed."""
    return np.stack([np.interp(at, passed, path[:, j]) for j in range(path.shape[1])], axis=1)
