"""What a fit needs of matrices and residuals: windows, correlation, inverses."""

from __future__ import annotations

import numpy as np

from ir_description import PowerParameters
from ir_msgs_py.arrays import FloatArray
from ir_recorder.measure import Samples

WINDOW = 5  # samples whose mean is one residual: 50 ms
_SHORTEST_REST = 0.3  # s


def rests(samples: Samples) -> list[tuple[int, int]]:
    """Rows (first, behind the last) of rests of at least 0.3 s: a posture's error is no noise
    either.
    """
    still = samples.known & ~samples.moving
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    return [
        (a, b) for a, b in edges.reshape(-1, 2).tolist() if (b - a) * samples.step >= _SHORTEST_REST
    ]


def by_window(values: FloatArray) -> FloatArray:
    """Means (M // WINDOW, ...) of consecutive samples (M, ...)."""
    count = len(values) // WINDOW
    return np.asarray(
        values[: count * WINDOW].reshape(count, WINDOW, *values.shape[1:]).mean(axis=1)
    )


def safe(deviation: FloatArray) -> FloatArray:
    """Deviations (P,) to divide by: 1 for what is certain."""
    return np.where(deviation > 0.0, deviation, 1.0)


def scaled(prior: PowerParameters) -> FloatArray:
    """The correlation (P, P) of the prior; 1 on the diagonal for what is certain."""
    scale = safe(prior.deviation)
    matrix = prior.covariance / np.outer(scale, scale)
    matrix[np.diag_indices_from(matrix)] = 1.0
    return matrix


def inverse(precision: FloatArray, deviation: FloatArray) -> FloatArray:
    """The covariance (P, P), inverted where parameters have deviations of one size; 0 for what is
    certain.
    """
    scale = safe(deviation)
    inverse = np.linalg.inv(precision * np.outer(scale, scale)) * np.outer(scale, scale)
    certain = deviation <= 0.0
    inverse[certain] = 0.0
    inverse[:, certain] = 0.0
    return np.asarray(inverse)


def correlation_length(residual: FloatArray) -> float:
    """Residuals (W,) per independent one: 1 + 2 times the autocorrelations up to the first
    negative.
    """
    own = residual - residual.mean() if len(residual) else residual
    power = float(own @ own)
    if len(own) < 3 or power <= 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, min(len(own) // 2, 400)):
        rho = float(own[:-lag] @ own[lag:]) / power
        if rho <= 0.0:
            break
        total += 2.0 * rho
    return total
