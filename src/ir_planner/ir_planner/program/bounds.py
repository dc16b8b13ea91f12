"""What a movement costs at least, whatever its path: proved from limits, friction and weight.

Every joint covers at least the straight distance. That takes at least the time of a bang-bang law
within its speed and acceleration, and does at least the work of Coulomb friction over the distance
and of viscous friction at an even speed. The potential energy (weight less counterbalance) changes
by what the ends say. Losses in the motors and what the brake resistor takes are not counted, so the
bound is below the true cost.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_planner.scene import MotionLimits, PlanningScene

# of the line over which static torque is integrated: smooth over a few rad, error below 0.01 J
_PLACES = 64


@dataclass(frozen=True)
class Rates:
    """What is minimised, as cost per joule of the drives and per second."""

    joule: float
    second: float


def potential_energy(q: FloatArray, scene: PlanningScene) -> FloatArray:
    """Weight's potential less the counterbalance's (K,) [J] at q (K, n), relative to all joints at
    0.
    """
    share = (np.arange(_PLACES) + 0.5) / _PLACES
    places = (q[:, None, :] * share[None, :, None]).reshape(-1, q.shape[1])
    still = np.zeros_like(places)
    torque = scene.dynamics.inverse_dynamics(places, still, still).reshape(len(q), _PLACES, -1)
    return np.asarray((torque.mean(axis=1) * q).sum(axis=1))


def least_seconds(distance: FloatArray, limits: MotionLimits) -> FloatArray:
    """Fewest seconds (...) from rest to rest over distances (..., n) rad within speed and
    acceleration.
    """
    speed = limits.velocity
    acceleration = limits.acceleration
    ramps = 2.0 * np.sqrt(distance / acceleration)
    cruise = distance / speed + speed / acceleration
    return np.asarray(
        np.where(distance >= (speed * speed) / acceleration, cruise, ramps).max(axis=-1)
    )


def least_cost(
    first: FloatArray, second: FloatArray, scene: PlanningScene, limits: MotionLimits, rates: Rates
) -> FloatArray:
    """Lower bounds (A, B) of movements from rest at `first` (A, n) to rest at `second` (B, n)."""
    distance = np.abs(second[None] - first[:, None])
    robot = scene.cell.robot
    seconds = least_seconds(distance, limits)
    rise = potential_energy(second, scene)[None] - potential_energy(first, scene)[:, None]
    work = rise + portable.matmul(distance, robot.friction_coulomb)
    viscous = portable.matmul(
        distance * distance, robot.friction_viscous
    )  # J s: joules at an even speed, times the duration
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.sqrt(rates.joule * viscous / rates.second) if rates.second > 0.0 else np.inf
        if scene.dc_bus.regeneration != "fed_back":  # energy from the mains is never negative
            best = np.minimum(best, np.where(work < 0.0, viscous / -work, np.inf))
        at = np.maximum(seconds, best)
        energy = work + np.where(at > 0.0, viscous / at, 0.0)
    if scene.dc_bus.regeneration != "fed_back":
        energy = np.maximum(energy, 0.0)
    time = np.where(np.isfinite(at), at, 0.0) * rates.second
    return np.asarray(rates.joule * energy + time)
