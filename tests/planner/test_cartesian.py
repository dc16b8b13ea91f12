"""Paths of the tool: what is certified keeps to the path and its speed; what can't be names the
place.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner import CartesianPlan, Planner
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of paths
from _second_opinion import SecondOpinion
from cartesian import MARGIN, oracle, random_path, seen

DOWN = Rotation.from_euler("y", 90.0, degrees=True)


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)


@pytest.fixture(scope="module")
def demo() -> Planner:
    return Planner("demo", clock=lambda: 0.0)


def pose(x: float, y: float, z: float, rotation: Rotation = DOWN) -> FloatArray:
    T = np.eye(4)
    T[:3, :3] = rotation.as_matrix()
    T[:3, 3] = (x, y, z)
    return T


def line(*poses: FloatArray) -> tuple[CartesianSegment, ...]:
    return tuple(CartesianSegment("line", (one,)) for one in poses)


def planned(planner: Planner, path: CartesianPath, **more: object) -> CartesianPlan:
    return planner.plan_cartesian(path, **more)  # type: ignore[arg-type]


TILTED = Rotation.from_euler("yz", (75.0, 20.0), degrees=True)
PATHS = {
    "line": CartesianPath(pose(1.8, -0.3, 1.2), line(pose(1.8, 0.3, 1.2)), tool_speed=0.25),
    "turning": CartesianPath(
        pose(1.7, -0.2, 1.2), line(pose(1.9, 0.3, 1.4, TILTED)), tool_speed=0.4
    ),
    "circle": CartesianPath(
        pose(1.8, -0.3, 1.2),
        (CartesianSegment("circle", (pose(1.6, 0.0, 1.2), pose(1.8, 0.3, 1.2))),),
        tool_speed=0.2,
    ),
    "spline": CartesianPath(
        pose(1.8, -0.3, 1.2),
        (
            CartesianSegment(
                "spline", (pose(1.7, 0.0, 1.3), pose(1.8, 0.2, 1.2), pose(1.9, 0.4, 1.2))
            ),
        ),
        tool_speed=0.2,
    ),
    "corner": CartesianPath(
        pose(1.7, -0.2, 1.2),
        line(pose(1.7, 0.2, 1.2), pose(1.9, 0.2, 1.2)),
        0.15,
        blending_radius=0.08,
    ),
}


@pytest.mark.parametrize("name", sorted(PATHS))
def test_the_tool_keeps_to_its_path_and_its_speed(planner: Planner, name: str) -> None:
    path = PATHS[name]
    plan = planned(planner, path)
    assert plan.status.ok, plan.status.message
    assert plan.report.certified
    assert plan.trajectory is not None
    assert planner.trajectories.get(plan.trajectory.trajectory_id) == plan.trajectory
    found = seen(plan.trajectory, path, planner.scene())
    assert found.error <= plan.tool_error + 1e-7  # the judge's own polyline
    assert plan.tool_error <= 1e-4
    assert found.axis <= plan.rotation_error + 1e-5
    assert found.speed <= path.speed_tolerance
    assert plan.speed_deviation <= path.speed_tolerance
    assert np.all(np.diff([0.0, *plan.lengths]) > 0.0)
    assert len(plan.lengths) == len(path.segments)


def judged(planner: Planner, seed: int) -> None:
    """A random path is kept as the answer says, or refused where no oracle drives it."""
    scene = planner.scene()
    rng = np.random.default_rng(seed)
    path = random_path(rng, scene)
    plan = planned(planner, path)
    if plan.trajectory is None:
        assert " m" in plan.status.message, "the place"
        assert not oracle(path, scene, rng), plan.status.message
        return
    found = seen(plan.trajectory, path, scene)
    assert found.error <= plan.tool_error + 1e-6, (
        "a place of the judge lies between two of its polyline"
    )
    assert found.speed <= path.speed_tolerance


def test_a_path_that_begins_near_a_singularity_is_driven_slowly_there() -> None:
    """A circle whose first millimetre bends A3 beyond its acceleration at any short ramp."""
    planner = Planner("deep_box", clock=lambda: 0.0)
    path = random_path(np.random.default_rng(5069), planner.scene())
    plan = planned(planner, path)
    assert plan.status.ok, plan.status.message
    assert plan.report.certified
    found = seen(plan.trajectory, path, planner.scene())
    assert found.error <= plan.tool_error + 1e-6
    assert found.speed <= path.speed_tolerance


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(20008, id="wrist_turns_fast_at_a_slow_start"),
        pytest.param(20132, id="with_a_free_angle"),
        pytest.param(20135, id="ramps_as_long_as_the_line"),
    ],
)
def test_what_passes_near_a_singularity_or_needs_long_ramps_is_driven(
    demo: Planner, seed: int
) -> None:
    path = random_path(np.random.default_rng(seed), demo.scene())
    plan = demo.plan_cartesian(path, options=PlanOptions(safety_distance=MARGIN))
    assert plan.trajectory is not None, plan.status.message
    found = seen(plan.trajectory, path, demo.scene())
    assert found.error <= plan.tool_error + 1e-6
    assert found.speed <= path.speed_tolerance


def test_where_no_configuration_leads_on_the_axis_is_named(demo: Planner) -> None:
    path = random_path(np.random.default_rng(20030), demo.scene())
    refused = demo.plan_cartesian(path, options=PlanOptions(safety_distance=MARGIN)).status.message
    assert "past 0.504 m" in refused
    assert "joint_a1 reaches its limit of 185 deg" in refused
    assert "free_angle" in refused


@pytest.mark.parametrize(
    "seeds", [range(4), pytest.param(range(4, 40), marks=pytest.mark.long)], ids=str
)
def test_random_paths_are_kept_or_refused_with_their_place(planner: Planner, seeds: range) -> None:
    for seed in seeds:
        judged(planner, seed)


@pytest.mark.long
@pytest.mark.parametrize("cell", ["demo", "table_columns", "cnc_door", "deep_box"])
def test_no_judge_objects_to_what_is_certified(cell: str) -> None:
    planner = Planner(cell, clock=lambda: 0.0)
    scene = planner.scene()
    judge = SecondOpinion(planner.scene())
    for seed in range(10):
        plan = planned(planner, random_path(np.random.default_rng(seed), scene))
        if plan.trajectory is not None:
            assert judge.largest_share(plan.trajectory) <= 1.0 + 1e-6
            assert judge.clearance_left(plan.trajectory, MARGIN, step=0.002)[0] >= -2e-6


def test_approach_and_retract_lead_along_the_axis_of_the_tool(planner: Planner) -> None:
    ends = pose(1.8, -0.2, 1.2), pose(1.8, 0.2, 1.2)
    plan = planned(planner, CartesianPath(ends[0], line(ends[1]), 0.2, approach=0.1, retract=0.05))
    assert plan.trajectory is not None, plan.status.message
    first, last = planner.scene().chain.tcp_poses(plan.trajectory.positions[[0, -1]])[:, :3, 3]
    assert np.allclose(first, ends[0][:3, 3] - 0.1 * ends[0][:3, 0], atol=1e-4)
    assert np.allclose(last, ends[1][:3, 3] - 0.05 * ends[1][:3, 0], atol=1e-4)
    assert np.allclose(plan.lengths, [0.5], atol=1e-6)


def test_a_free_angle_serves_and_stays_within_its_bound(planner: Planner) -> None:
    ends = pose(1.8, -0.3, 1.2), pose(1.8, 0.3, 1.2)
    fixed, free = (
        planned(planner, CartesianPath(ends[0], line(ends[1]), 0.2, free_angle=angle))
        for angle in (0.0, 0.4)
    )
    assert fixed.trajectory is not None
    assert free.trajectory is not None
    tcp = planner.scene().chain.tcp_poses(free.trajectory.positions)
    turned = ends[0][:3, :3].T @ tcp[:, :3, :3]
    assert np.abs(np.arctan2(turned[:, 2, 1], turned[:, 1, 1])).max() <= 0.4 + 1e-3
    assert free.report.energy <= fixed.report.energy * 1.001
    assert free.configurations > fixed.configurations


def test_a_line_too_short_for_its_speed_says_how_fast_it_is(planner: Planner) -> None:
    line_of_600_mm = line(pose(1.8, 0.3, 1.2))
    plan = planned(
        planner, CartesianPath(pose(1.8, -0.3, 1.2), line_of_600_mm, 10.0, speed_tolerance=1.0)
    )
    assert plan.status.ok
    notes = [stage.note for stage in plan.info.stages if stage.name == "speed"]
    assert len(notes) == 1
    assert "too short for 10 m/s" in notes[0]


def test_poses_that_are_none_are_refused_at_the_door() -> None:
    for wrong in (np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([2.0, 2.0, 2.0, 1.0]), np.ones((4, 4))):
        with pytest.raises(InvalidValueError, match="start is no rotation with a place"):
            CartesianPath(wrong, line(pose(1.8, 0.3, 1.2)))


def test_the_same_path_gives_the_same_bytes(planner: Planner) -> None:
    first = planned(planner, PATHS["line"])
    second = planned(planner, PATHS["line"])
    assert first.trajectory == second.trajectory
    assert first.trajectory is not None


def test_what_cannot_be_driven_names_its_place(planner: Planner) -> None:
    far = planned(planner, CartesianPath(pose(1.8, 0.0, 1.2), line(pose(3.8, 0.0, 1.2))))
    assert far.status.code == StatusCode.NO_IK_SOLUTION
    assert " m: " in far.status.message
    fast = planned(
        planner, CartesianPath(pose(1.8, -0.3, 1.2), line(pose(1.8, 0.3, 1.2)), tool_speed=5.0)
    )
    assert fast.status.code == StatusCode.INVALID_MOTION_PLAN
    assert "tool_speed" in fast.status.message
    corner = planned(
        planner, CartesianPath(pose(1.7, -0.2, 1.2), line(pose(1.7, 0.2, 1.2), pose(1.9, 0.2, 1.2)))
    )
    assert "at 0.400 m the path has a corner of 90.0 deg" in corner.status.message
