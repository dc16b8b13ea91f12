"""A judge of paths of the tool that shares nothing with the planner: places by formulas of its own,
the tool by Pinocchio, its speed by differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio
from _pinocchio_arm import pinocchio_arm
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation, Slerp

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene import PlanningScene

_DENSE = 2e-4  # m between the places of a path
_RATE = 1000.0  # Hz
_CUBIC = 4  # places from which on a spline is cubic


@dataclass(frozen=True)
class Seen:
    """error [m]: largest distance from the path outside rounded corners; axis [rad]: largest angle
    between the tool's axis and the one asked for, on single lines; speed: by what share the tool is
    off its speed.
    """

    error: float
    axis: float
    speed: float


def places(segment: CartesianSegment, start: FloatArray) -> FloatArray:
    """Dense places (M, 3) m of a segment from `start` (3,)."""
    ends = [start, *(pose[:3, 3] for pose in segment.poses)]
    if segment.kind == "circle":
        return _circle(*ends)
    if len(ends) == 2:
        return np.asarray(np.linspace(ends[0], ends[1], _count(ends)))
    u = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1))])
    fine = np.linspace(0.0, u[-1], 2 * _count(ends))
    if len(ends) < _CUBIC:
        return np.column_stack(
            [np.polyval(np.polyfit(u, axis, 2), fine) for axis in np.transpose(ends)]
        )
    return np.asarray(CubicSpline(u, np.array(ends))(fine))


def _count(ends: list[FloatArray]) -> int:
    return int(np.ceil(np.linalg.norm(np.diff(ends, axis=0), axis=1).sum() / _DENSE)) + 2


def _circle(start: FloatArray, via: FloatArray, end: FloatArray) -> FloatArray:
    """The centre is as far from all three and in their plane: three linear equations."""
    normal = np.cross(via - start, end - start)
    rows = np.array([via - start, end - start, normal])
    right = [0.5 * (via @ via - start @ start), 0.5 * (end @ end - start @ start), normal @ start]
    centre = np.linalg.solve(rows, right)
    axis = normal / np.linalg.norm(normal)
    arm = start - centre
    to = end - centre
    angle = np.arctan2(np.cross(arm, to) @ axis, arm @ to) % (2.0 * np.pi)
    count = int(np.ceil(angle * np.linalg.norm(arm) / _DENSE)) + 2
    turns = Rotation.from_rotvec(np.linspace(0.0, angle, count)[:, None] * axis)
    return np.asarray(centre + turns.apply(arm))


def seen(trajectory: JointTrajectory, path: CartesianPath, scene: PlanningScene) -> Seen:
    """What a trajectory makes of a path without approach and retract."""
    times = np.arange(0.0, trajectory.duration, 1.0 / _RATE)
    tcp = _tool(trajectory.sample(times).q, scene)
    whole = []
    corners = []
    start = path.start[:3, 3]
    for segment in path.segments:
        whole.append(places(segment, start))
        start = segment.poses[-1][:3, 3]
        corners.append(start)
    dense = np.concatenate(whole)
    away, along = _from_polyline(tcp[:, :3, 3], dense)
    inner = np.array(corners[:-1]).reshape(-1, 3)
    if len(inner):
        near = np.linalg.norm(tcp[:, None, :3, 3] - inner[None], axis=2).min(axis=1)
        away = away[near > path.blending_radius + 1e-3]
    return Seen(float(away.max()), _axis(tcp, along, path), _speed(tcp, path))


def _tool(q: FloatArray, scene: PlanningScene) -> FloatArray:
    """Poses (M, 4, 4) of the tcp by Pinocchio."""
    model = pinocchio_arm(scene.cell.robot, (), scene.cell.base_pose)
    data = model.createData()
    found = np.empty((len(q), 4, 4))
    for k, one in enumerate(q):
        pinocchio.forwardKinematics(model, data, one)
        found[k] = data.oMi[model.njoints - 1].homogeneous
    return np.asarray(scene.cell.base_pose @ found @ scene.cell.tcp)


def _from_polyline(points: FloatArray, dense: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances (M,) m from a polyline, and how far along it [m] the nearest places are."""
    steps = np.linalg.norm(np.diff(dense, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    nearest = cKDTree(dense).query(points)[1]
    best = np.full(len(points), np.inf)
    along = np.zeros(len(points))
    for shift in (-1, 0):
        k = np.clip(nearest + shift, 0, len(dense) - 2)
        edge = dense[k + 1] - dense[k]
        size = np.maximum((edge * edge).sum(axis=1), 1e-18)
        share = np.clip(((points - dense[k]) * edge).sum(axis=1) / size, 0.0, 1.0)
        distance = np.linalg.norm(points - dense[k] - share[:, None] * edge, axis=1)
        along = np.where(distance < best, length[k] + share * np.sqrt(size), along)
        best = np.minimum(best, distance)
    return best, along


def _axis(tcp: FloatArray, along: FloatArray, path: CartesianPath) -> float:
    """The tool's axis on a single line of given orientation; 0 elsewhere."""
    segment = path.segments[0]
    if len(path.segments) > 1 or segment.kind != "line" or path.orientation == "tangent":
        return 0.0
    end = path.start if path.orientation == "constant" else segment.poses[0]
    ends = Rotation.from_matrix(np.stack([path.start[:3, :3], end[:3, :3]]))
    length = float(np.linalg.norm(segment.poses[0][:3, 3] - path.start[:3, 3]))
    asked = Slerp([0.0, 1.0], ends)(np.clip(along / length, 0.0, 1.0)).as_matrix()[:, :, 0]
    return float(np.linalg.norm(np.cross(asked, tcp[:, :3, 0]), axis=1).max())


def _speed(tcp: FloatArray, path: CartesianPath) -> float:
    """By what share the tool is off its speed between the first and the last time it reaches it."""
    speed = np.linalg.norm(np.diff(tcp[:, :3, 3], axis=0), axis=1) * _RATE
    reached = np.flatnonzero(speed >= path.tool_speed * (1.0 - 0.1 * path.speed_tolerance))
    if len(reached) == 0:
        return 1.0
    kept = speed[reached[0] : reached[-1] + 1]
    return float(np.abs(kept / path.tool_speed - 1.0).max())
