"""A tool that turns in place, and one that turns no faster than asked, judged by Pinocchio's
kinematics and SciPy's rotations.
"""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

from ir_description import robot_urdf
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_planner import Planner, RequestError
from ir_planner.cartesian import CartesianPlan
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

CELLS = ("open", "kr6_bench", "ur10e_bench")
STEP_S = 2e-3
ROUNDING = 1e-6
DRAWN = 6


def poses_of(planner: Planner, plan: CartesianPlan) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times (M,) s, places (M, 3) m and rotations (M, 3, 3) of the tcp by Pinocchio."""
    cell = planner.cell
    model = pinocchio.buildModelFromXML(robot_urdf(cell.robot, (), cell.tcp))
    data = model.createData()
    hand = model.getFrameId("tcp")
    assert plan.trajectory is not None
    duration = plan.trajectory.duration
    times = np.linspace(0.0, duration, int(duration / STEP_S) + 2)
    found = []
    for q in plan.trajectory.sample(times).q:
        pinocchio.framesForwardKinematics(model, data, q)
        found.append(np.asarray(cell.base_pose) @ data.oMf[hand].homogeneous)
    poses = np.array(found)
    return times, poses[:, :3, 3], poses[:, :3, :3]


def turning_speeds(times: FloatArray, rotations: FloatArray) -> FloatArray:
    """rad/s between samples."""
    turns = Rotation.from_matrix(rotations[:-1].transpose(0, 2, 1) @ rotations[1:])
    return np.asarray(turns.magnitude() / np.diff(times))


def start_of(planner: Planner, rng: np.random.Generator) -> FloatArray:
    """A free pose (4, 4) near the middle of the reach, the tool somehow down or forward."""
    robot = planner.cell.robot
    reach = float(np.abs(robot.joint_origin[1:, :3, 3]).sum())
    while True:
        around = rng.uniform(-0.8, 0.8)
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("ZYX", [around, rng.uniform(0.4, 1.6), 0.0]).as_matrix()
        radius = rng.uniform(0.4, 0.55) * reach
        pose[:3, 3] = np.asarray(planner.cell.base_pose)[:3, 3]
        pose[:3, 3] += (radius * np.cos(around), radius * np.sin(around), 0.35 * reach)
        if planner.compute_ik(pose).solutions:
            return pose


def turned(pose: FloatArray, rng: np.random.Generator, largest: float) -> FloatArray:
    axis = rng.normal(0.0, 1.0, 3)
    angle = rng.uniform(0.1, largest)
    end = pose.copy()
    end[:3, :3] = (
        pose[:3, :3] @ Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    )
    return end


@pytest.mark.parametrize("cell", CELLS)
def test_it_turns_along_the_slerp_at_the_speed_asked(cell: str) -> None:
    planner = Planner(cell, clock=itertools.repeat(0.0).__next__)
    driven = 0
    for case in range(DRAWN):
        rng = np.random.default_rng([case, 11])
        start = start_of(planner, rng)
        end = turned(start, rng, 1.0)
        speed = float(rng.uniform(0.05, 0.6))
        path = CartesianPath(start, (CartesianSegment("line", (end,), 0.0, speed),))
        plan = planner.plan_cartesian(path)
        if plan.trajectory is None:
            assert plan.status.message
            continue
        driven += 1
        assert plan.report.certified
        times, places, rotations = poses_of(planner, plan)
        assert np.linalg.norm(places - start[:3, 3], axis=1).max() <= plan.tool_error + ROUNDING
        whole = Rotation.from_matrix(start[:3, :3].T @ end[:3, :3]).as_rotvec()
        angle = np.linalg.norm(whole)
        done = Rotation.from_matrix(start[:3, :3].T @ rotations)
        along = np.clip(done.as_rotvec() @ (whole / angle), 0.0, angle)
        slerp = Rotation.from_rotvec(along[:, None] * (whole / angle))
        off = (slerp.inv() * done).magnitude().max()
        assert off <= plan.rotation_error + ROUNDING
        assert (Rotation.from_matrix(rotations[-1].T @ end[:3, :3])).magnitude() <= 1e-6
        speeds = turning_speeds(times, rotations)
        most = speed * (1.0 + plan.speed_deviation) + 1e-4
        assert speeds.max() <= most
        if angle / speed > 1.0:  # long enough for ramps
            middle = speeds[len(speeds) // 2]
            assert middle >= speed * (1.0 - plan.speed_deviation) - 1e-4
    assert driven >= DRAWN // 2


@pytest.mark.parametrize("kind", ["line", "circle", "spline"])
def test_a_moving_tool_turns_no_faster_than_asked(kind: str) -> None:
    planner = Planner("kr6_bench", clock=itertools.repeat(0.0).__next__)
    rng = np.random.default_rng(3)
    start = start_of(planner, rng)
    poses = [start]
    for offset in ((0.0, 0.03, 0.02), (0.0, 0.06, 0.0)):
        pose = turned(start, rng, 0.5)
        pose[:3, 3] = start[:3, 3] + offset
        poses.append(pose)
    segment = CartesianSegment(kind, tuple(poses[2:] if kind == "line" else poses[1:]))
    fast, slow = (
        planner.plan_cartesian(
            CartesianPath(start, (segment,), 0.05, speed_tolerance=1.0, rotation_speed=turning)
        )
        for turning in (0.0, 0.1)
    )
    assert fast.status.ok, fast.status.message
    assert slow.status.ok, slow.status.message
    assert turning_speeds(*poses_of(planner, fast)[::2]).max() > 0.12
    speeds = turning_speeds(*poses_of(planner, slow)[::2])
    assert speeds.max() <= 0.1 * (1.0 + max(slow.speed_deviation, 1e-3)) + 1e-4


def test_a_turn_between_lines_stops_and_counts_along_the_path() -> None:
    planner = Planner("open", clock=itertools.repeat(0.0).__next__)
    rng = np.random.default_rng(0)
    start = start_of(planner, rng)
    away = start.copy()
    away[1, 3] += 0.1
    there = away.copy()
    there[:3, :3] = start[:3, :3] @ Rotation.from_rotvec([0.4, 0.0, 0.0]).as_matrix()
    back = there.copy()
    back[:3, 3] = start[:3, 3]
    segments = tuple(CartesianSegment("line", (pose,)) for pose in (away, there, back))
    plan = planner.plan_cartesian(CartesianPath(start, segments, rotation_speed=0.3))
    assert plan.status.ok, plan.status.message
    np.testing.assert_allclose(plan.lengths, [0.1, 0.2, 0.3], atol=1e-9)


def test_what_makes_no_sense_is_refused() -> None:
    planner = Planner("open", clock=itertools.repeat(0.0).__next__)
    start = start_of(planner, np.random.default_rng(0))
    with pytest.raises(RequestError, match=r"turned by 0 rad: it must be at least 0.0001 m"):
        planner.plan_cartesian(CartesianPath(start, (CartesianSegment("line", (start,)),)))
    with pytest.raises(InvalidValueError, match=r"rotation_speed is 30 rad/s"):
        CartesianSegment("line", (start,), 0.0, 30.0)
    with pytest.raises(InvalidValueError, match="orientation tangent"):
        CartesianPath(
            start, (CartesianSegment("line", (start,)),), orientation="tangent", rotation_speed=0.1
        )
