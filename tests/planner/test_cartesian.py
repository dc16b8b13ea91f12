"""Paths of the tool: what is certified keeps to the path and its speed; what can't be names the place."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner import CartesianPlan, Planner

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of paths
from _tool_path_judge import seen

DOWN = Rotation.from_euler("y", 90.0, degrees=True)


@pytest.fixture(scope="module")
def planner() -> Planner:
    planner = Planner(time.monotonic)
    planner.set_cell("", "open")
    return planner


def pose(x: float, y: float, z: float, rotation: Rotation = DOWN) -> FloatArray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation.as_matrix(), (x, y, z)
    return T


def line(*poses: FloatArray) -> tuple[CartesianSegment, ...]:
    return tuple(CartesianSegment("line", (one,)) for one in poses)


def planned(planner: Planner, path: CartesianPath, **more: object) -> CartesianPlan:
    return planner.plan_cartesian(path, PlanOptions(), **more)  # type: ignore[arg-type]


TILTED = Rotation.from_euler("yz", (75.0, 20.0), degrees=True)
PATHS = {
    "line": CartesianPath(pose(1.8, -0.3, 1.2), line(pose(1.8, 0.3, 1.2)), tool_speed=0.25),
    "turning": CartesianPath(pose(1.7, -0.2, 1.2), line(pose(1.9, 0.3, 1.4, TILTED)), tool_speed=0.4),
    "circle": CartesianPath(
        pose(1.8, -0.3, 1.2),
        (CartesianSegment("circle", (pose(1.6, 0.0, 1.2), pose(1.8, 0.3, 1.2))),),
        tool_speed=0.2,
    ),
    "spline": CartesianPath(
        pose(1.8, -0.3, 1.2),
        (CartesianSegment("spline", (pose(1.7, 0.0, 1.3), pose(1.8, 0.2, 1.2), pose(1.9, 0.4, 1.2))),),
        tool_speed=0.2,
    ),
    "corner": CartesianPath(
        pose(1.7, -0.2, 1.2), line(pose(1.7, 0.2, 1.2), pose(1.9, 0.2, 1.2)), 0.15, blending_radius=0.08
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


def test_the_same_path_gives_the_same_bytes(planner: Planner) -> None:
    first, second = planned(planner, PATHS["line"]), planned(planner, PATHS["line"])
    assert first.trajectory == second.trajectory
    assert first.trajectory is not None


def test_what_cannot_be_driven_names_its_place(planner: Planner) -> None:
    far = planned(planner, CartesianPath(pose(1.8, 0.0, 1.2), line(pose(3.8, 0.0, 1.2))))
    assert far.status.code == StatusCode.NO_IK_SOLUTION
    assert " m: " in far.status.message
    fast = planned(planner, CartesianPath(pose(1.8, -0.3, 1.2), line(pose(1.8, 0.3, 1.2)), tool_speed=5.0))
    assert fast.status.code == StatusCode.INVALID_MOTION_PLAN
    assert "tool_speed" in fast.status.message
    corner = planned(
        planner, CartesianPath(pose(1.7, -0.2, 1.2), line(pose(1.7, 0.2, 1.2), pose(1.9, 0.2, 1.2)))
    )
    assert "at 0.400 m the path has a corner of 90.0 deg" in corner.status.message
