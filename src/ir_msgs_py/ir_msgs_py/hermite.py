"""Hermite polynomials between trajectory points: quintic, cubic or linear by what the points know.

A quintic Hermite segment reproduces a cubic one exactly, so planners of splines send one point per
knot.
"""

from __future__ import annotations

import numpy as np

from ir_msgs_py.arrays import FloatArray


def hermite_coefficients(
    q: FloatArray, qd: FloatArray | None, qdd: FloatArray | None, durations: FloatArray
) -> FloatArray:
    """Coefficients c (S, n, 6) of q(t) = sum_k c_k t^k [s] through points q, qd, qdd (S+1, n)."""
    T = durations[:, None]
    delta = q[1:] - q[:-1]
    c = np.zeros((len(durations), q.shape[1], 6))
    c[:, :, 0] = q[:-1]
    if qd is None:
        c[:, :, 1] = delta / T
        return c
    v0 = qd[:-1]
    v1 = qd[1:]
    c[:, :, 1] = v0
    if qdd is None:
        c[:, :, 2] = (3.0 * delta / T - 2.0 * v0 - v1) / T
        c[:, :, 3] = (-2.0 * delta / T + v0 + v1) / T**2
        return c
    a0 = qdd[:-1]
    a1 = qdd[1:]
    c[:, :, 2] = 0.5 * a0
    c[:, :, 3] = (20.0 * delta / T - 8.0 * v1 - 12.0 * v0 - (3.0 * a0 - a1) * T) / (2.0 * T**2)
    c[:, :, 4] = (-30.0 * delta / T + 14.0 * v1 + 16.0 * v0 + (3.0 * a0 - 2.0 * a1) * T) / (
        2.0 * T**3
    )
    c[:, :, 5] = (12.0 * delta / T - 6.0 * (v0 + v1) - (a0 - a1) * T) / (2.0 * T**4)
    return c


def evaluate(c: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """q and its first three derivatives (M, n) of polynomials c (6, M, n) at local times t (M,)
    [s].
    """
    s = t[:, None]
    c0, c1, c2, c3, c4, c5 = c
    q = ((((c5 * s + c4) * s + c3) * s + c2) * s + c1) * s + c0
    qd = (((5.0 * c5 * s + 4.0 * c4) * s + 3.0 * c3) * s + 2.0 * c2) * s + c1
    qdd = ((20.0 * c5 * s + 12.0 * c4) * s + 6.0 * c3) * s + 2.0 * c2
    qddd = (60.0 * c5 * s + 24.0 * c4) * s + 6.0 * c3
    return q, qd, qdd, qddd
