"""Splines from rest to rest along given points, and descents that start from them."""

from typing import Any

import numpy as np

from ir_kernels.spline_terms import SplineTerms
from ir_values.arrays import FloatArray, IntArray


def fewest_seconds(path: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> float:
    """A guess that is seldom too long: a path (M, n) at full speed, or from rest to rest as its
    longest joint.
    """
    steps = np.abs(np.diff(path, axis=0))
    at_speed = float((steps / velocity).max(axis=1).sum())
    return max(at_speed, 2.0 * float(np.sqrt((steps.sum(axis=0) / acceleration).max())))


def spline_along(
    path: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    settings: tuple[float, float, float, int, int],
) -> tuple[FloatArray, float]:
    """Control points (K, n) and interval along a path (M, n), by its length and slowly at both
    ends;
    settings: spacing, slower, duration, fewest, most.
    """
    spacing, slower, duration, fewest, most = settings
    least = fewest_seconds(path, velocity, acceleration)
    count = int(np.clip(np.ceil(least / spacing), fewest, most))
    share = np.arange(1, count + 1) / (count + 1)
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = share * share * (3.0 - 2.0 * share) * passed[-1]
    inner = np.stack([np.interp(at, passed, joint) for joint in path.T], axis=1)
    control = np.concatenate(
        [np.repeat(path[:1], 3, axis=0), inner, np.repeat(path[-1:], 3, axis=0)]
    )
    return control, (duration or slower * least) / (count + 3)


def descend_along(
    core: Any,
    terms: SplineTerms,
    points: FloatArray,
    counts: IntArray,
    settings: tuple[float, float, float, int, int],
    evaluations: int,
    tolerance: float,
) -> list[tuple[FloatArray, float, float, int]]:
    """What a core's `descend` returns, from starts along paths: points (P, n) one path after the
    other, counts (L,) of them.
    """
    found = []
    for path in np.split(points, np.cumsum(counts)[:-1]):
        control, interval = spline_along(path, terms.velocity, terms.acceleration, settings)
        row = np.zeros(len(control) - 3, np.int32)
        fixed = settings[2] > 0.0
        control, *ended = core.descend(control, row, interval, fixed, evaluations, tolerance)
        found.append((np.clip(control, terms.low, terms.high), *ended))
    return found
