"""Cost of a movement by the masses that it swings, eq. (9): W = sum_i w_i |q_{s+1}^i - q_s^i| with
w_i = 1/2 sum_{l=i..n} m_l qd_{l,max}^2: a joint near the base carries more of the arm and counts
more. (As printed the lower index of the sum makes all weights equal; it starts at the joint.)
"""

from __future__ import annotations

import numpy as np

from ir_kernels import portable
from ir_values.arrays import FloatArray


def movement_weights(
    link_mass: FloatArray, velocity_max: FloatArray, load_mass: float = 0.0
) -> FloatArray:
    """Weights w (n,) of eq. (9) [kg rad^2/s^2].

    `link_mass` (n+1,) kg from the base on (the base never moves and does not count), `velocity_max`
    (n,) rad/s, `load_mass` kg is carried by the last link.
    """
    mass = np.array(link_mass[1:], dtype=float)
    mass[-1] += load_mass
    kinetic = 0.5 * mass * np.square(velocity_max)
    return np.ascontiguousarray(np.cumsum(kinetic[::-1])[::-1])


def movement_cost(weights: FloatArray, start: FloatArray, goal: FloatArray) -> FloatArray:
    """W of the movement from `start` to `goal`, shapes (..., n) that broadcast; result (...)."""
    return np.asarray(portable.matmul(np.abs(np.asarray(goal) - np.asarray(start)), weights))


def path_cost(weights: FloatArray, waypoints: FloatArray) -> float:
    """W summed over the steps of a path (N, n)."""
    return float(np.sum(portable.matmul(np.abs(np.diff(waypoints, axis=0)), weights)))
