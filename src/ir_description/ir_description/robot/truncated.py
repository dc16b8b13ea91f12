"""Draws of a normal distribution that physics cuts off: correlations hold at the bounds too.

Only parameters that have a bound within reach are drawn one after the other, each from its own
distribution given the others (Geweke, 1991); the others follow from them in one step.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr, ndtri

from ir_msgs_py.arrays import BoolArray, FloatArray

_REACH = 6.0  # standard deviations: what lies beyond is not drawn in a lifetime
_SWEEPS = 60
_RIDGE = 1e-9  # relative: covariances of a file are rounded


def truncated_normal(
    mean: FloatArray,
    covariance: FloatArray,
    low: FloatArray,
    high: FloatArray,
    count: int,
    seed: int,
) -> FloatArray:
    """Vectors (count, P) of N(mean (P,), covariance (P, P)) between low and high (P,).

    What has no deviation stays at its mean.
    """
    generator = np.random.default_rng(seed)
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    free = deviation > 0.0
    scale = deviation[free]
    matrix = covariance[np.ix_(free, free)] / np.outer(scale, scale)
    matrix = matrix + _RIDGE * np.eye(len(matrix))
    least = (low - mean)[free] / scale
    most = (high - mean)[free] / scale
    near = np.asarray((least > -_REACH) | (most < _REACH))
    drawn = np.empty((count, len(scale)))
    drawn[:, near] = _bounded(matrix[np.ix_(near, near)], least[near], most[near], count, generator)
    drawn[:, ~near] = _following(matrix, near, drawn[:, near], generator)
    result = np.tile(mean, (count, 1))
    result[:, free] += scale * np.clip(drawn, least, most)
    return np.asarray(np.clip(result, low, high))


def _bounded(
    matrix: FloatArray,
    least: FloatArray,
    most: FloatArray,
    count: int,
    generator: np.random.Generator,
) -> FloatArray:
    """Draws (count, B) about 0 with covariance (B, B) between the bounds (B,)."""
    size = len(matrix)
    precision = np.linalg.inv(matrix)
    deviation = 1.0 / np.sqrt(np.diag(precision))
    alone = np.array_equal(matrix, np.diag(np.diag(matrix)))
    drawn = np.clip(np.zeros((count, size)), least, most)
    for _ in range(1 if alone else _SWEEPS):
        for j in range(size):
            middle = drawn[:, j] - drawn @ precision[:, j] * deviation[j] ** 2
            first = ndtr((least[j] - middle) / deviation[j])
            last = ndtr((most[j] - middle) / deviation[j])
            share = first + (last - first) * generator.random(count)
            value = middle + deviation[j] * ndtri(np.clip(share, 1e-12, 1.0 - 1e-12))
            drawn[:, j] = np.clip(value, least[j], most[j])
    return drawn


def _following(
    matrix: FloatArray, near: BoolArray, given: FloatArray, generator: np.random.Generator
) -> FloatArray:
    """Draws (count, F) of those that are not near a bound, given the others (count, B)."""
    own = matrix[np.ix_(~near, ~near)]
    across = matrix[np.ix_(~near, near)]
    gain = np.linalg.solve(matrix[np.ix_(near, near)], across.T).T if near.any() else across
    values, vectors = np.linalg.eigh(own - gain @ across.T)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(given @ gain.T + generator.standard_normal((len(given), len(own))) @ root.T)
