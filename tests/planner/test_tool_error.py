"""Bounds of how the tool keeps to its path hold at every instant: by differences, far finer than
samples.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_planner import Planner
from ir_planner.cartesian.orientations import (
    Evenly,
    RotationRates,
    ThroughPoses,
    about_tool,
    rates_of,
)
from ir_planner.checks import tool_derivatives

ROOT = np.sqrt(2.0)
STEP = 1e-4


def differences(rotations: np.ndarray) -> tuple[float, float]:
    """Largest |R'| and |R''| of rotations (M, 3, 3) at `STEP`, as RotationRates are meant."""
    first = np.diff(rotations, axis=0) / STEP
    second = np.diff(first, axis=0) / STEP
    return tuple(float(np.linalg.norm(one, axis=(1, 2)).max()) / ROOT for one in (first, second))


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_rotations_turn_no_faster_than_their_rates(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 0.3, 4))])
    poses = Rotation.from_rotvec(rng.normal(size=(5, 3))).as_matrix()
    s = np.arange(0.0, at[-1], STEP)
    spline = make_interp_spline(at, rng.normal(size=5), k=3)
    even = Evenly.between(poses[0], poses[1], at[-1])
    turning: dict[str, tuple[RotationRates, np.ndarray]] = {
        "evenly": (even.rates, even.at(s)),
        "through poses": (ThroughPoses(at, poses).rates, ThroughPoses(at, poses).at(s)),
        "about the tool": (rates_of(spline), about_tool(spline(s))),
        "both": (even.rates.then(rates_of(spline)), even.at(s) @ about_tool(spline(s))),
    }
    for name, (rates, rotations) in turning.items():
        first, second = differences(rotations)
        assert first <= rates.first * (1.0 + 1e-6) + 1e-9, name
        assert second <= rates.second * (1.0 + 1e-6) + 1e-3, name
        assert second >= 0.02 * rates.second, f"{name}: the bound is useless"


def test_the_tool_keeps_within_the_bounds_of_its_path(planner: Planner) -> None:
    """On a spline with turning and a corner, at 20 kHz."""
    start = np.array([[0.0, 0, 1, 1.8], [0, 1, 0, -0.3], [-1, 0, 0, 1.2], [0, 0, 0, 1]])
    poses = [start.copy() for _ in range(3)]
    for k, pose in enumerate(poses):
        pose[:3, 3] += (0.1 * (k % 2), 0.15 * (k + 1), 0.05 * k)
        pose[:3, :3] = start[:3, :3] @ Rotation.from_rotvec([0.0, 0.1 * k, 0.15 * k]).as_matrix()
    path = CartesianPath(start, (CartesianSegment("spline", tuple(poses)),), tool_speed=0.2)
    plan = planner.plan_cartesian(path)
    trajectory = plan.trajectory
    scene = planner.scene()
    assert trajectory is not None, plan.status.message
    times = np.arange(0.0, trajectory.duration, 5e-5)
    tcp = scene.chain.tcp_poses(trajectory.sample(times).q)
    speed = np.linalg.norm(np.diff(tcp[:, :3, 3], axis=0), axis=1) / 5e-5
    inner = slice(len(speed) // 5, -len(speed) // 5)
    off = np.abs(speed[inner] / path.tool_speed - 1.0).max()
    assert off <= plan.speed_deviation
    assert plan.speed_deviation <= off + 1e-3, "the bound is close"
    assert 0.0 < plan.rotation_error < 3e-4
    motion = tool_derivatives(trajectory, scene)
    moved = {2: motion.acceleration, 3: motion.jerk}
    for order, bound in moved.items():
        values = np.linalg.norm(np.diff(tcp[::20, :3, 3], n=order, axis=0), axis=1) / 1e-3**order
        assert values.max() <= bound.max()
        assert values.max() >= 0.01 * bound.max(), "the bound is useless"
