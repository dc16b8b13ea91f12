"""A motion is slowed down to its limits wherever an even slow-down keeps them, hardly more than
needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ir_planner.curves import UniformSpline, along_path, fewest_seconds
from ir_planner.optimize.spline_cost import slowed_to_limits
from ir_planner.scene import MotionLimits, PlanningScene, torque_use

SLOWEST = 1e3  # times as long: inertia is gone
NEEDED = 1.02  # times the least duration: rounds end a little below the limits


def use(spline: UniformSpline, limits: MotionLimits, scene: PlanningScene) -> float:
    """Largest share of a limit that is used; at most 1: within all of them."""
    top = spline.extremes()
    torque = torque_use(scene.dynamics, *spline.samples(6)).max() / limits.torque_share
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    kept = zip((top.velocity, top.acceleration, top.jerk), bounds, strict=True)
    return float(max(torque, *((value / bound).max() for value, bound in kept)))


@pytest.mark.parametrize("seed", range(12))
def test_a_load_near_the_envelope_is_slowed_down_as_little_as_needed(
    seed: int, scene_of: Callable[[str], PlanningScene]
) -> None:
    scene = scene_of("demo")
    rng = np.random.default_rng(seed)
    robot = scene.cell.robot
    ends = np.array(scene.cell.park) + rng.uniform(-0.6, 0.6, (2, robot.n))
    path = np.clip(ends, robot.position_min, robot.position_max)
    least = fewest_seconds(path, scene.limits.velocity, scene.limits.acceleration)
    spline = along_path(path, 24, least * rng.uniform(1.0, 1.5))
    weight = torque_use(scene.dynamics, *UniformSpline(spline.control, SLOWEST).samples(6)).max()
    limits = replace(
        scene.limits, torque_share=float(weight * (1.0 + 10.0 ** rng.uniform(-3.0, -0.5)))
    )
    found = slowed_to_limits(spline, limits, scene)
    assert found is not None
    assert use(found, limits, scene) <= 1.0 + 1e-12
    low = spline.interval
    high = max(found.interval, spline.interval)
    for _ in range(50):
        middle = 0.5 * (low + high)
        within = use(UniformSpline(spline.control, middle), limits, scene) <= 1.0
        low, high = (low, middle) if within else (middle, high)
    assert found.interval <= NEEDED * high
