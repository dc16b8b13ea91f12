"""Joint splines of eq. (10): cubics through given points with speed and acceleration given at both
ends.

Each segment runs in its own normalised time u in [0, 1]. The first and the last segment carry the
conditions at the ends, the middle ones join with continuous q, qd and qdd. Giving q, qd and qdd at
both ends leaves no freedom for two of the inner positions: the second and the second last knot are
virtual, their positions follow. (As printed the linear coefficient of the last segment ends in a_f
t_n / 2; only with a_f t_n^2 / 2 do the end conditions hold.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ir_kernels import portable
from ir_values.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


class JointSpline(NamedTuple):
    """Knots (K,) s with q, qd, qdd (K, n) at each; between knots every joint is a cubic, so nothing
    else is needed.
    """

    times: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray


def virtual_knots(point_times: FloatArray) -> FloatArray:
    """Knots (M+2,) for points passed at `point_times` (M,): one virtual knot halves the first and
    last interval.

    With two points the three intervals are equal: a movement of three cubics.
    """
    t = np.asarray(point_times, dtype=float)
    if len(t) == 2:
        return np.linspace(t[0], t[1], 4)
    return np.concatenate([t[:1], [(t[0] + t[1]) / 2], t[1:-1], [(t[-2] + t[-1]) / 2], t[-1:]])


def spline_through(
    points: FloatArray,
    point_times: FloatArray,
    knots: FloatArray,
    start: tuple[FloatArray, FloatArray] | None = None,
    end: tuple[FloatArray, FloatArray] | None = None,
) -> JointSpline:
    """The C2 spline of eq. (10) through `points` (M, n) at `point_times` (M,) s, cubic between
    `knots` (M+2,) s.

    `start` and `end`: speed and acceleration (n,) there; None is rest. The knots are the point
    times and two virtual ones. Raises ValueError when times do not increase.
    """
    points = np.asarray(points, dtype=float)
    if np.any(np.diff(knots) <= 0.0) or np.any(np.diff(point_times) <= 0.0):
        raise ValueError("times of a spline must increase")
    rest = (np.zeros(points.shape[1]), np.zeros(points.shape[1]))
    v0, a0 = start or rest
    vf, af = end or rest
    full = np.concatenate([np.repeat(knots[0], 4), knots[1:-1], np.repeat(knots[-1], 4)])
    ends = ((v0, a0), (vf, af))
    spline = portable.interpolating_spline(point_times, points, knots=full, ends=ends)
    q = spline(knots)
    qd = spline(knots, 1)
    qdd = spline(knots, 2)
    q[0] = points[0]
    q[-1] = points[-1]
    qd[0] = v0
    qd[-1] = vf
    qdd[0] = a0
    qdd[-1] = af
    return JointSpline(np.asarray(knots, dtype=float), q, qd, qdd)


def natural_durations(points: FloatArray, velocity_max: FloatArray) -> FloatArray:
    """Durations (M-1,) s in which the fastest joint of each step runs at its speed limit: a first
    guess.
    """
    return np.asarray(np.max(np.abs(np.diff(points, axis=0)) / velocity_max, axis=1))


def to_ppoly(spline: JointSpline) -> PPoly:
    """The spline as scipy's piecewise polynomial."""
    from scipy.interpolate import PPoly

    h = np.diff(spline.times)[:, None]
    jerk = np.diff(spline.accelerations, axis=0) / h
    c = np.stack(
        [jerk / 6, spline.accelerations[:-1] / 2, spline.velocities[:-1], spline.positions[:-1]]
    )
    return PPoly(c, spline.times)
