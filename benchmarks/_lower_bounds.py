"""What no movement between two configurations can undercut: its time, its drive energy and W of eq.
(9).

Time: every joint alone, from rest to rest within speed, acceleration and jerk. Energy: Coulomb
friction over the distance that each joint has to turn, viscous friction (at least b d^2 / T), and
the potential energy of arm, load and gas spring that is gained; the capacitor starts empty, so that
it gives nothing. These are exact
inequalities: a search that prunes by them loses nothing.
"""

from __future__ import annotations

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_planner.scene import PlanningScene

_SAMPLES = 200  # of a straight line along which static torque is integrated


def least_times(distance: FloatArray, v: FloatArray, a: FloatArray, j: FloatArray) -> FloatArray:
    """Least time [s] from rest to rest over distances (..., n) within speed, acceleration, jerk
    (n,).
    """
    ramp = np.where(
        v * j >= a * a, a / j + v / a, 2.0 * np.sqrt(v / j)
    )  # time to reach the speed v
    cruising = 2.0 * ramp + (distance - v * ramp) / v
    speed = 0.5 * (np.sqrt((a * a / j) ** 2 + 4.0 * a * distance) - a * a / j)
    accelerating = 2.0 * (a / j + speed / a)
    jerking = 4.0 * np.cbrt(distance / (2.0 * j))
    short = np.where((distance >= 2.0 * a**3 / j**2) & (v * j >= a * a), accelerating, jerking)
    return np.asarray(np.where(distance >= v * ramp, cruising, short))


def potential_gain(scene: PlanningScene, start: FloatArray, goals: FloatArray) -> FloatArray:
    """Potential energy (K,) J gained from start (n,) to goals (K, n): static torque is
    conservative.
    """
    t = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    steps = goals - start
    q = start + t[None, :, None] * steps[:, None, :]
    flat = np.ascontiguousarray(q.reshape(-1, q.shape[-1]))
    still = np.zeros_like(flat)
    torque = scene.dynamics.inverse_dynamics(flat, still, still).reshape(q.shape)
    return np.asarray((torque * steps[:, None, :]).sum(axis=(1, 2)) / _SAMPLES)


def least_cost(
    scene: PlanningScene, start: FloatArray, goals: FloatArray, time_value: float
) -> FloatArray:
    """Lower bound (K,) of J = drive energy + time_value [W] x T from start (n,) to goals (K, n)."""
    robot = scene.cell.robot
    distance = np.abs(goals - start)
    least = least_times(distance, robot.velocity_max, robot.acceleration_max, robot.jerk_max).max(
        axis=1
    )
    viscous = distance**2 @ robot.friction_viscous
    constant = distance @ robot.friction_coulomb + potential_gain(scene, start, goals)
    T = np.maximum(np.maximum(least, np.sqrt(viscous / time_value)), 1e-9)  # of the least sum
    return np.asarray(np.maximum(constant + viscous / T + time_value * T, time_value * least))


def least_travel(scene: PlanningScene, start: FloatArray, goals: FloatArray) -> FloatArray:
    """Lower bound (K,) of W: that of the straight movement."""
    return np.asarray(np.abs(goals - start) @ scene.weights)
