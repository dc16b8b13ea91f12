"""The reported clearance is a bound: Coal finds no smaller distance at any instant."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.distances import clearance_profile
from ir_planner.checks.evaluation import evaluate_trajectory
from ir_planner.scene.planning_scene import PlanningScene
from ir_values.arrays import FloatArray

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the shapes of a scene in Coal

from _coal_shapes import CoalScene

SceneOf = Callable[[str], PlanningScene]
COAL = 2e-6  # m: what Coal's iterations leave between it and the true distance


def coal_distance(scene: PlanningScene, q: FloatArray) -> float:
    """Smallest distance [m] over all pairs at q (n,), by Coal."""
    capsules = [*scene.cell.robot.capsules, *(c for load in scene.loads for c in load.capsules)]
    theirs = CoalScene(capsules, scene.cell.bodies(), gjk_tolerance=1e-9)
    poses = scene.chain.link_poses(q[None])[0]
    return min(theirs.distance(*pair, poses) for pair in scene.collision.pairs)


def wandering(scene: PlanningScene, seed: int) -> JointTrajectory:
    """A trajectory of quintics between random configurations of the cell, free or not."""
    rng = np.random.default_rng(seed)
    robot = scene.cell.robot
    middle = np.array(scene.cell.park)
    spread = 0.3 * (robot.position_max - robot.position_min)
    points = np.clip(
        middle + rng.uniform(-spread, spread, (4, robot.n)), robot.position_min, robot.position_max
    )
    zero = np.zeros_like(points)
    times = np.cumsum(rng.integers(300_000_000, 2_000_000_000, 4)) - 300_000_000
    speeds = rng.uniform(-0.5, 0.5, points.shape)
    speeds[[0, -1]] = 0.0
    return JointTrajectory(robot.joint_names, times - times[0], points, speeds, zero)


@settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    cell=st.sampled_from(["demo", "cnc_door", "table_columns", "deep_box", "kr6_bench"]),
    seed=st.integers(0, 10_000),
)
def test_no_distance_is_below_the_bound(cell: str, seed: int, scene_of: SceneOf) -> None:
    scene = scene_of(cell)
    trajectory = wandering(scene, seed)
    profile = clearance_profile(trajectory, scene)
    assert profile.smallest is not None
    q = trajectory.sample(np.arange(0.0, trajectory.duration, 5e-4)).q
    near = scene.collision.min_distance(q).distance  # only to choose where Coal looks
    lowest = [*np.argsort(near)[:8], *np.random.default_rng(seed).integers(0, len(q), 8)]
    if profile.bound > 0.0:  # in penetration depths of the two differ in kind
        assert min(coal_distance(scene, q[k]) for k in lowest) >= profile.bound - COAL
        lasting = (near <= near.min() + 1e-5).mean() > 0.15
        assert profile.smallest.distance - profile.bound <= (1.1e-4 if lasting else 1.1e-5)
    assert near.min() >= profile.bound


@pytest.mark.parametrize("margin", [0.0, 0.02])
def test_a_certified_movement_reports_no_less_than_its_safety_distance(
    margin: float, demo_scene: PlanningScene
) -> None:
    home = np.array(demo_scene.cell.park)
    still = np.stack([home, home])
    zero = np.zeros_like(still)
    trajectory = JointTrajectory(
        demo_scene.cell.robot.joint_names, np.array([0, 10**9]), still, zero, zero
    )
    distance = float(demo_scene.collision.distances(home[None]).min())
    report = evaluate_trajectory(trajectory, demo_scene, margin or distance).report
    assert report.certified
    assert (margin or distance) - 1.1e-6 <= report.min_clearance <= distance
