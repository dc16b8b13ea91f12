"""A tool that turns, in place or along a line, no faster than asked: four cells of three robots.

The judge is Pinocchio with SciPy's rotations: place, turn off the slerp and turning speed at
samples 1 ms apart.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pinocchio
from _pinocchio_arm import pinocchio_arm
from _requests_rows import Row
from scipy.spatial.transform import Rotation

from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_planner import Planner
from ir_planner.cartesian import CartesianPlan

CELLS = ("open", "table_columns", "kr6_bench", "ur10e_bench")
SAMPLE_S = 1e-3
ROUNDING = 1e-6  # m, rad
SLACK = 2e-4  # rad/s that differences of samples may add


def _drawn(planner: Planner, rng: np.random.Generator) -> CartesianPath:
    """A turn about any axis, in place or along a line, at a speed that is asked for."""
    robot = planner.cell.robot
    reach = float(np.abs(robot.joint_origin[1:, :3, 3]).sum())
    base = np.asarray(planner.cell.base_pose)[:3, 3]
    while True:
        around = rng.uniform(-np.pi, np.pi)
        radius = rng.uniform(0.35, 0.6) * reach
        start = np.eye(4)
        start[:3, :3] = Rotation.from_euler("ZYX", [around, rng.uniform(0.2, 1.6), 0.0]).as_matrix()
        start[:3, 3] = base + np.array(
            [radius * np.cos(around), radius * np.sin(around), rng.uniform(0.2, 0.5) * reach]
        )
        if planner.compute_ik(start).solutions:
            break
    axis = rng.normal(0.0, 1.0, 3)
    turn = Rotation.from_rotvec(rng.uniform(0.1, 1.5) * axis / np.linalg.norm(axis)).as_matrix()
    end = start.copy()
    end[:3, :3] = start[:3, :3] @ turn
    if rng.uniform() < 0.5:
        way = rng.normal(0.0, 1.0, 3)
        end[:3, 3] += 0.1 * reach * way / np.linalg.norm(way)
    speed = float(rng.uniform(0.05, 0.5))
    segment = CartesianSegment("line", (end,))
    return CartesianPath(start, (segment,), 0.1, 1.0, rotation_speed=speed)


def _objections(planner: Planner, path: CartesianPath, plan: CartesianPlan) -> list[str]:
    """What the judge finds beyond the errors that are stated."""
    cell = planner.cell
    model = pinocchio_arm(cell.robot)
    data = model.createData()
    assert plan.trajectory is not None
    duration = plan.trajectory.duration
    times = np.linspace(0.0, duration, int(duration / SAMPLE_S) + 2)
    found = []
    for q in plan.trajectory.sample(times).q:
        pinocchio.forwardKinematics(model, data, q)
        last = data.oMi[model.njoints - 1].homogeneous
        found.append(np.asarray(cell.base_pose) @ last @ np.asarray(cell.tcp))
    poses = np.array(found)
    first = np.array(path.start)
    end = np.array(path.segments[0].poses[0])
    line = end[:3, 3] - first[:3, 3]
    length = float(np.linalg.norm(line))
    whole = Rotation.from_matrix(first[:3, :3].T @ end[:3, :3]).as_rotvec()
    angle = float(np.linalg.norm(whole))
    done = Rotation.from_matrix(first[:3, :3].T @ poses[:, :3, :3])
    along = np.clip(done.as_rotvec() @ (whole / angle), 0.0, angle)
    share = along / angle
    places = first[:3, 3] + share[:, None] * line
    wrong = []
    slack = plan.rotation_error * length / angle
    if np.linalg.norm(poses[:, :3, 3] - places, axis=1).max() > plan.tool_error + slack + ROUNDING:
        wrong.append("the tcp is farther from its place than stated")
    slerp = Rotation.from_rotvec(along[:, None] * (whole / angle))
    if (slerp.inv() * done).magnitude().max() > plan.rotation_error + ROUNDING:
        wrong.append("the tool is turned farther off the slerp than stated")
    turns = Rotation.from_matrix(poses[:-1, :3, :3].transpose(0, 2, 1) @ poses[1:, :3, :3])
    fastest = float((turns.magnitude() / np.diff(times)).max())
    if fastest > path.rotation_speed * (1.0 + max(plan.speed_deviation, 1e-3)) + SLACK:
        wrong.append("the tool turns faster than asked")
    return wrong


def rows(count: int) -> Iterator[Row]:
    """So many cases, a cell after the other."""
    planners = [Planner(cell) for cell in CELLS]
    for case in range(count):
        rng = np.random.default_rng([case, 6])
        planner = planners[case % len(CELLS)]
        path = _drawn(planner, rng)
        began = time.process_time()
        plan = planner.plan_cartesian(path)
        seconds = time.process_time() - began
        name = f"{CELLS[case % len(CELLS)]}, case {case}"
        if plan.trajectory is None:
            why = plan.status.message.split(":")[0]
            yield Row(name, "".join(c for c in why if not c.isdigit())[:70], False, (), seconds)
            continue
        wrong = _objections(planner, path, plan)
        report = plan.report
        joules = report.energy - report.base_energy
        joules += planner.cell.robot.time_value * report.duration
        yield Row(name, "", report.certified, tuple(wrong), seconds, joules)
