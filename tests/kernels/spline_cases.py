"""Robots, scenes, terms and random motions for the tests of the cost along a spline."""

from dataclasses import replace
from typing import Any

import numpy as np
from geometry_cases import CAPSULES, COLUMNS, KR210, SELF_PAIRS, TCP, Body, Capsule, every_kind
from robots import RobotLiteral, coupled, kr210, random_chain, tool_155
from scipy.interpolate import BSpline

from ir_kernels import Chain, CollisionModel, DynamicsModel, SplineCost
from ir_kernels.spline_terms import SplineTerms
from ir_values.arrays import FloatArray

FEW = ("l3b", "l6", "t_bar", "t_part")  # capsules that a quick scene has


def terms(robot: RobotLiteral, pairs: int, **changes: Any) -> SplineTerms:
    """The robot's own bounds, 20 mm of clearance, and a cost of everything."""
    n = len(robot.velocity_max)
    default = SplineTerms(
        robot.velocity_max,
        robot.acceleration_max,
        robot.jerk_max,
        robot.position_min,
        robot.position_max,
        np.full(n, 20.0),
        np.full((1, pairs), 0.02),
        time_value=500.0,
        capacity_energy=106.0,
    )
    return replace(default, **changes)


def kr210_models(
    bodies: tuple[Body, ...] = COLUMNS, *, few: bool = False, robot: RobotLiteral | None = None
) -> tuple[CollisionModel, DynamicsModel]:
    """A KR 210 with 155 kg among bodies, with all its capsules or few."""
    own = () if few else SELF_PAIRS
    capsules = [capsule for capsule in CAPSULES if not few or capsule.name in FEW]
    collision = CollisionModel(Chain(KR210, tcp=TCP), capsules, bodies, own)
    return collision, DynamicsModel(robot or kr210(), (tool_155(),))


def kr210_cost(
    core: Any, bodies: tuple[Body, ...] = COLUMNS, *, few: bool = False, **changes: Any
) -> SplineCost:
    collision, dynamics = kr210_models(bodies, few=few)
    return SplineCost(
        collision, dynamics, terms(kr210(), len(collision.pairs), **changes), core=core
    )


def chain_models(
    seed: int, n: int, *, wrist: bool = False
) -> tuple[RobotLiteral, CollisionModel, DynamicsModel]:
    """A random chain without a counterbalance, a capsule on each link, among bodies of all
    kinds; wrist: with coupled motors.
    """
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, n)
    robot = coupled(robot, seed) if wrist else robot
    capsules = [
        Capsule(f"c{k}", k, rng.normal(0.0, 0.2, 3), rng.normal(0.0, 0.2, 3), 0.05)
        for k in range(1, n + 1)
    ]
    own = [(f"c{k}", f"c{k + 2}") for k in range(1, n - 1)]
    collision = CollisionModel(Chain(robot), capsules, every_kind(rng), own)
    return robot, collision, DynamicsModel(robot)


def motion(
    seed: int, K: int, n: int = 6, *, around: FloatArray | float = 0.0, size: float = 1.0
) -> FloatArray:
    """Control points (K, n) that swing slowly and shake a little."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 2.0 * np.pi, n)
    u = np.arange(K)[:, None] / K
    control: FloatArray = around + size * (
        0.7 * np.sin(4.0 * u + phase) + rng.normal(0.0, 0.02, (K, n))
    )
    return control


def at_rest(control: FloatArray) -> FloatArray:
    """The same motion with three equal points at both ends."""
    still = control.copy()
    still[:3] = control[0]
    still[-3:] = control[-1]
    return still


MIDDLE = (KR210.position_min + KR210.position_max) / 2.0
WORKING = np.deg2rad([0.0, -80.0, 100.0, 10.0, 40.0, 0.0])


def swing(K: int, degrees: float = 50.0) -> FloatArray:
    """A movement of the first axis and a little of the others, from rest to rest."""
    u = np.clip((np.arange(K) - 2.0) / (K - 5.0), 0.0, 1.0)[:, None]
    swing_by = np.deg2rad([2.0 * degrees, 10.0, -15.0, 20.0, 15.0, -40.0])
    control: FloatArray = WORKING + (u * u * (3.0 - 2.0 * u) - 0.5) * swing_by
    return control


def along(control: FloatArray, interval: float, at: FloatArray, order: int = 0) -> FloatArray:
    """The spline's derivative of that order at times `at` (N,) s, by scipy."""
    K = len(control)
    spline = BSpline((np.arange(K + 4) - 3.0) * interval, control, 3)
    values: FloatArray = spline(at, nu=order)
    return values


def sample_times(K: int, interval: float) -> FloatArray:
    """(2 (K - 3),): the beginnings of the halves of all intervals."""
    times: FloatArray = np.arange(2 * (K - 3)) * interval / 2.0
    return times
