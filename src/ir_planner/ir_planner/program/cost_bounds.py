"""Lower bounds of a movement's cost on any path: from limits, friction and weight."""

from typing import NamedTuple

import numpy as np

from ir_kernels import SplineCost, portable
from ir_kernels.spline_terms import SplineTerms
from ir_planner.curves import UniformSpline, along_path, fewest_seconds
from ir_planner.request import Context
from ir_planner.scene import MotionLimits, PlanningScene
from ir_planner.timing import objective_weights
from ir_values.arrays import FloatArray

# What a movement costs at least, whatever its path: proved from limits, friction and weight.
#
# Every joint covers at least the straight distance. That takes at least the time of a bang-bang
# law within its speed and acceleration, and does at least the work of Coulomb friction over the
# distance and of viscous friction at an even speed. The potential energy (weight less
# counterbalance) changes by what the ends say. Losses in the motors and what the brake resistor
# takes are not counted, so the bound is below the true cost.

# of the line over which static torque is integrated: smooth over a few rad, error below 0.01 J
_PLACES = 64


class Rates(NamedTuple):
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
    return np.asarray((torque.mean(axis=1) * scene.dynamics.coupling.motors(q)).sum(axis=1))


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
    travel = np.abs(robot.coupling.motors(second[None] - first[:, None]))  # of the motors, at least
    work = rise + portable.matmul(travel, robot.friction_coulomb)
    # J s: joules at an even speed, times the duration
    viscous = portable.matmul(travel * travel, robot.friction_viscous)
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


# What a movement would cost if nothing were in its path: a coarse solution that never meets a
# body.
#
# The descent is that of movements, on a spline with fewer points, without clearance. A movement
# that keeps clear of everything has one constraint more, so it costs as much or more, but for two
# things: the descent may end in a poorer local minimum than the planner's, and a coarse spline
# bends less. COST_MARGIN is for both; benchmarks/program.py judges it by what chosen chains cost
# above the best of all chains.

COST_MARGIN = 0.04  # share of a coarse cost by which the planner's movement may be cheaper
_SPACING = 0.1  # s between the knots of the coarse spline
# its control points
_FEWEST = 12
_MOST = 64
_SLOWER = 1.3  # than the straight segment at full speed: where the descent starts
_STIFFNESS = 4.0  # of penalties, against the objective's power: limits may be exceeded a little
_EVALUATIONS = (80, 60)  # on the coarse spline, and on one with a knot more in every interval


class CoarseCost:
    """Costs of movements in one scene, whatever stands there."""

    def __init__(self, context: Context, rates: Rates) -> None:
        self.context = context
        self.rates = rates
        scene = context.scene
        limits = context.limits
        robot = scene.cell.robot
        nobody = np.full((1, len(scene.collision.pairs)), -np.inf)
        ends = np.zeros((2, robot.n))
        weights = objective_weights(context, ends)
        self.weights = weights
        terms = SplineTerms(
            limits.velocity,
            limits.acceleration,
            limits.jerk,
            robot.position_min,
            robot.position_max,
            weights.travel,
            nobody,
            torque_share=limits.torque_share,
            energy_value=weights.energy,
            time_value=weights.time,
            capacity_energy=scene.dc_bus.capacity_energy,
            regeneration=scene.dc_bus.regeneration,
            penalty=_STIFFNESS * weights.power,
            clearance_penalty=0.0,
        )
        self.cost = SplineCost(scene.collision, scene.dynamics, terms)

    def between(self, first: FloatArray, second: FloatArray) -> float:
        """Cost of the coarse movement from rest at first (n,) to rest at second (n,)."""
        ends = np.stack([first, second])
        limits = self.context.limits
        least = fewest_seconds(ends, limits.velocity, limits.acceleration)
        count = int(np.clip(np.ceil(least / _SPACING), _FEWEST, _MOST))
        spline = along_path(ends, count, _SLOWER * least)
        value = np.inf
        for evaluations in _EVALUATIONS:
            found = self.cost.descend(spline.control, spline.interval, evaluations=evaluations)
            value = found.value
            spline = UniformSpline(found.control, found.interval).subdivided()
        # the descent's weights differ from the rates by a factor where time alone counts
        scale = self.rates.second / self.weights.time if self.rates.joule == 0.0 else 1.0
        return float(value) * scale
