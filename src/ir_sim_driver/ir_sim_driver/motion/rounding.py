"""Trajectories of positions alone: their corners are rounded, so that velocity never jumps.

The linear interpolant has corners, which no drive can follow. What is executed is its mean over the
last w = blend_time: q~(t) = 1/w int_{t-w}^{t} q(u) du, a piecewise parabola with q~' continuous and
q~'' = (q'(t) - q'(t - w)) / w. A cubic Hermite spline through its knots t_i and t_i + w is exactly
it.
"""

from __future__ import annotations

import numpy as np

from ir_msgs_py.arrays import FloatArray, IntArray
from ir_msgs_py.trajectory import NS_PER_S, JointTrajectory

_APART = 100_000  # ns; between nearer knots the rounding of positions would count as acceleration


def rounded(trajectory: JointTrajectory, blend_time: float) -> JointTrajectory:
    """The trajectory that is executed: itself when it carries velocities, else its mean over
    blend_time [s].

    It ends blend_time later. Before a first time 0 the robot rests; before a later one the mean
    continues the first line, so that what leads in meets it in motion.
    """
    if trajectory.velocities is not None or len(trajectory.times_ns) < 2:
        return trajectory
    window_ns = round(blend_time * NS_PER_S)
    given = trajectory.times_ns
    knots = np.unique(np.concatenate((given, given + window_ns)))
    first = int(given[0])
    t = (given - first) / NS_PER_S
    q = trajectory.positions
    start = q[0] if first == 0 else q[0] - (q[1] - q[0]) / t[1] * blend_time
    t = np.concatenate(([-blend_time], t, [t[-1] + blend_time]))
    at = (knots - first) / NS_PER_S
    now, then = (_interpolated(t, np.vstack((start, q, q[-1])), x) for x in (at, at - blend_time))
    velocities = (now - then) / blend_time
    velocities[-1] = 0.0
    # q~' is a line between knots: its integral keeps neighbours consistent to the last bit
    steps = np.diff(at)[:, None] * 0.5 * (velocities[1:] + velocities[:-1])
    mean = 0.5 * (start + q[0]) + np.vstack((np.zeros(q.shape[1]), np.cumsum(steps, axis=0)))
    mean[-1] = q[-1]
    kept = _apart(knots)
    return JointTrajectory(trajectory.joint_names, knots[kept], mean[kept], velocities[kept])


def _apart(knots: IntArray) -> IntArray:
    """Indices of knots (N,) [ns], ascending, that are at least _APART apart; the first and the last
    stay.
    """
    kept = [0]
    for k in range(1, len(knots) - 1):
        if knots[k] - knots[kept[-1]] >= _APART and knots[-1] - knots[k] >= _APART:
            kept.append(k)
    return np.array([*kept, len(knots) - 1])


def _interpolated(t: FloatArray, q: FloatArray, at: FloatArray) -> FloatArray:
    """Values (M, n) at times (M,) of lines through q (N, n) at t (N,)."""
    return np.stack([np.interp(at, t, column) for column in q.T], axis=1)
