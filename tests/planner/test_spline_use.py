"""What rounds of timing ask of the spline of eq. (10) is what holds for the trajectory that is
sent.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import extremes, spline_through, virtual_knots
from ir_planner.scene.motion_limits import torque_use
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.timing.spline_timing import spline_use

NAMES = tuple(f"joint_a{k}" for k in range(1, 7))
ROUNDING = 1e-9  # relative: two formulas for the same cubics


def sent_use(points: np.ndarray, milliseconds: np.ndarray, scene: PlanningScene) -> np.ndarray:
    """The same by the interpolant of the trajectory, its exact extremes and its own samples."""
    knots = np.rint(virtual_knots(np.concatenate([[0], np.cumsum(milliseconds)]))).astype(np.int64)
    at = np.concatenate([[0], np.cumsum(milliseconds)]) * 1e-3
    spline = spline_through(points, at, knots * 1e-3)
    values = spline.positions, spline.velocities, spline.accelerations
    trajectory = JointTrajectory(NAMES, knots * 1_000_000, *values)
    largest = extremes(*trajectory.coefficients())
    limits = scene.limits
    use = np.zeros(len(points) - 1)
    for k, (begin, end) in enumerate(pairwise(knots)):
        motion = trajectory.sample(np.linspace(begin, end, 9) * 1e-3)
        torque = torque_use(scene.dynamics, motion.q, motion.qd, motion.qdd).max()
        longer = max(
            (largest.velocity[k] / limits.velocity).max(),
            (largest.acceleration[k] / limits.acceleration).max() ** (1 / 2),
            (largest.jerk[k] / limits.jerk).max() ** (1 / 3),
            (torque / limits.torque_share) ** (1 / 2),
        )
        interval = min(max(k - 1, 0), len(use) - 1)
        use[interval] = max(use[interval], longer)
    return use


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 14), st.floats(0.02, 0.4))
def test_the_use_of_limits_is_that_of_the_trajectory_that_is_sent(
    demo_scene: PlanningScene, seed: int, count: int, longest: float
) -> None:
    rng = np.random.default_rng(seed)
    steps = rng.uniform(-0.1, 0.1, (count, 6))
    points = np.array(demo_scene.cell.machine_home) + np.cumsum(steps, axis=0)
    milliseconds = 2 * rng.integers(10, max(int(500 * longest), 11), count - 1)
    found = spline_use(points, milliseconds * 1e-3, demo_scene.limits, demo_scene.dynamics)
    np.testing.assert_allclose(found, sent_use(points, milliseconds, demo_scene), rtol=ROUNDING)
