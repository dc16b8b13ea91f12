"""Intervals of energies: what the uncertainty of the power parameters leaves open.

Powers change linearly with the parameters, but the bus does not: slopes are taken at the mean of
the drawn robots, where optimised movements no longer balance between drawing power and dissipating
it.

All energies of one set of parameters are sampled over the same drawn robots, so that a difference
of two energies has an interval of its own, mostly far narrower than theirs.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

from ir_description import PowerParameters, interval_over
from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.energy_slopes import Sampled, energy_and_slope, sampled_energy
from ir_planner.scene import PlanningScene

ROBOTS = 1000  # drawn: the ends of a 90 % interval are then known to some 5 % of its width
SEED = 90


@dataclass(frozen=True)
class Interval:
    """5 % and 95 % quantile, J."""

    low: float
    high: float


@lru_cache(maxsize=16)
def robots(parameters: PowerParameters) -> FloatArray:
    """The drawn robots (ROBOTS, P); always the same for the same parameters."""
    return parameters.draws(ROBOTS, SEED)


@lru_cache(maxsize=16)
def expected(parameters: PowerParameters) -> PowerParameters:
    """The mean of the drawn robots: more than the parameters' mean where a loss can only be
    larger.
    """
    return replace(parameters, mean=robots(parameters).mean(axis=0))


@lru_cache(maxsize=64)
def expected_scene(scene: PlanningScene) -> PlanningScene:
    """The same scene with the mean of the drawn robots."""
    mean = expected(scene.parameters)
    drives = replace(scene.drives, parameters=mean)
    return replace(scene, drives=drives, power=mean.power_with(scene.power))


def spread(slope: FloatArray, parameters: PowerParameters) -> FloatArray:
    """What the drawn robots add (ROBOTS,) J to an energy that is linear with this slope (P,)."""
    return portable.matmul(robots(parameters) - parameters.mean, slope)


def movement_spread(trajectory: JointTrajectory, scene: PlanningScene) -> FloatArray:
    """What the drawn robots add (ROBOTS,) J to the energy of a movement."""
    at = Sampled.of(trajectory)
    there = expected_scene(scene)
    expected_energy, slope = energy_and_slope(at, there)
    drawn = robots(scene.parameters) - there.parameters.mean
    return expected_energy - sampled_energy(at, scene) + portable.matmul(drawn, slope)


def interval(nominal: float, added: FloatArray) -> Interval:
    """The 90 % interval of an energy [J] to which the drawn robots add `added` (ROBOTS,) J; it
    holds the nominal one.
    """
    return Interval(*interval_over(nominal, added))
