"""Spline blocks: several parts driven through without a stop.

Assumptions, where KUKA publishes no formula: a PTP_SPLINE is the interpolating spline of degree
five through its points; with one TIME_BLOCK over all of its parts it passes them at the marked
times, at rest at both ends. A SPLINE is the same of the tool, straight between the ends of its SLIN
parts and round along its SCIRC parts as far as a spline through their points is, at the speeds of
its first part.
"""

import numpy as np

from ir_kernels import portable
from ir_krl import KrlMotionError, Motion, SplineBlock, TimeBlock
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.cartesian import Line
from ir_planner.curves import RotationSpline, turn_of, turned_evenly
from ir_planner.krl.curves import AxisCurve, drawn_from, followed, through_axes
from ir_planner.krl.geometry import Arm
from ir_planner.krl.passing import resting_spline
from ir_planner.timing import GRID_NS, GRID_S

_LINE_POINTS = 9  # of an SLIN part, so that the spline through them is straight
_ARC_STEP = np.radians(
    5.0
)  # between points of an SCIRC part: the spline leaves the arc by 1e-6 of its radius
_STEP_M = 4e-3
_SAMPLES_MIN = 33
_SAMPLES_MAX = 20_001
_DEGREE = 5
_KNOTS_PER_S = 125


def block_curve(block: SplineBlock, start: FloatArray, arm: Arm) -> AxisCurve:
    """The curve of a block from the configuration `start` (n,). Raises KrlMotionError."""
    if block.axis:
        return through_axes(_axis_points(block, start, arm))
    return _tool_spline(block, start, arm)


def timed_block(block: SplineBlock, start: FloatArray, arm: Arm) -> JointTrajectory | None:
    """The trajectory from `start` (n,) of a PTP_SPLINE whose TIME_BLOCK times all its parts; else
    None.
    """
    whole = [one for one in block.times if one.first == 0 and one.last == len(block.parts)]
    if not block.axis or len(block.times) != 1 or not whole:
        return None
    points = _axis_points(block, start, arm)
    times = _passing_times(whole[0], len(block.parts))
    if times is None:
        return None
    times = times * (
        round(times[-1] / GRID_S) * GRID_S / times[-1]
    )  # at rest where the last point lies
    spline = resting_spline(times, points)
    inner = zip(
        times[:-1], times[1:], np.ceil(np.diff(times) * _KNOTS_PER_S).astype(int), strict=True
    )
    fine = np.concatenate([np.linspace(a, b, count + 1) for a, b, count in inner])
    steps = np.unique(np.rint(fine / GRID_S)).astype(np.int64)
    q, qd, qdd = (np.asarray(spline(steps * GRID_S, nu=k)) for k in range(3))
    qd[[0, -1]] = qdd[[0, -1]] = 0.0
    q[0] = points[0]
    q[-1] = points[-1]
    return JointTrajectory(arm.scene.cell.robot.joint_names, steps * GRID_NS, q, qd, qdd)


def _passing_times(block: TimeBlock, parts: int) -> FloatArray | None:
    """Times (parts + 1,) [s] at which the points are passed; None where marks leave some open."""
    marked = dict(block.marks)
    if set(marked) != set(range(1, parts)):
        return None
    shares = np.array([marked[k] for k in range(1, parts)])
    last = 100.0 - shares.sum()
    if (shares <= 0.0).any() or last <= 0.0:
        raise KrlMotionError(
            "TIME_BLOCK PART: shares are above 0 % and less than 100 % together", block.place
        )
    return np.concatenate([[0.0], np.cumsum([*shares, last])]) * (block.seconds / 100.0)


def _axis_points(block: SplineBlock, start: FloatArray, arm: Arm) -> FloatArray:
    points = [start]
    for part in block.parts:
        if part.kind not in ("ptp", "spl"):
            raise KrlMotionError("a PTP_SPLINE has SPTP parts only", part.place)
        points.append(arm.reached(part.target, points[-1], part.place))
    if np.abs(np.diff(points, axis=0)).max(axis=1).min() <= 0.0:
        raise KrlMotionError("a PTP_SPLINE goes to the same place twice in a row", block.place)
    return np.array(points)


def spline_poses(block: SplineBlock, start: FloatArray, arm: Arm) -> FloatArray:
    """Poses (N, 4, 4) of the tool in its base that a SPLINE passes, from the configuration `start`
    (n,). Raises KrlMotionError.
    """
    first = block.parts[0]
    poses = [arm.tool_pose(first.target, start)]
    for part in block.parts:
        if part.kind == "ptp":
            raise KrlMotionError("a SPLINE has SPL, SLIN and SCIRC parts only, no SPTP", part.place)
        if not np.array_equal(part.target.base, first.target.base) or not np.array_equal(
            part.target.tool, first.target.tool
        ):
            raise KrlMotionError("a SPLINE keeps its tool and its base", part.place)
        poses += _part(part, poses[-1], arm)
    return np.array(poses)


def _part(part: Motion, now: FloatArray, arm: Arm) -> list[FloatArray]:
    """Poses (4, 4) after `now` (4, 4) that a part passes: its end, and before it what makes it
    round.
    """
    if part.kind == "spl":
        end = arm.pose(part.target, now)
        end[:3, :3] = now[:3, :3] if part.keeps_orientation else end[:3, :3]
        return [end]
    last, path = drawn_from(part, now, arm)
    count = (
        _LINE_POINTS
        if isinstance(path, Line)
        else max(int(np.ceil(abs(path.angle) / _ARC_STEP)), _LINE_POINTS)
    )
    share = np.linspace(0.0, 1.0, count + 1)[1:]
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = path.at(share * path.length)
    poses[:, :3, :3] = turned_evenly(now[:3, :3], last[:3, :3], share)
    return list(poses)


def _tool_spline(block: SplineBlock, start: FloatArray, arm: Arm) -> AxisCurve:
    """The spline of the tool through the ends of the parts, followed by the axes."""
    first = block.parts[0]
    stacked = spline_poses(block, start, arm)
    steps = np.linalg.norm(np.diff(stacked[:, :3, 3], axis=0), axis=1)
    if steps.min() <= 0.0:
        raise KrlMotionError("a SPLINE goes to the same place twice in a row", block.place)
    length = float(steps.sum())
    u = np.concatenate([[0.0], np.cumsum(steps)]) / length
    fine = np.linspace(0.0, 1.0, int(np.clip(length / _STEP_M, _SAMPLES_MIN, _SAMPLES_MAX)))
    along = np.tile(np.eye(4), (len(fine), 1, 1))
    places = portable.interpolating_spline(u, stacked[:, :3, 3], min(3, len(u) - 1))
    along[:, :3, 3] = places(fine)
    along[:, :3, :3] = RotationSpline(u, stacked[:, :3, :3])(fine)
    q = followed(along, first, start, arm)
    turning = float(turn_of(portable.matmul(stacked[0, :3, :3].T, stacked[-1, :3, :3])))
    return AxisCurve(portable.interpolating_spline(fine, q, _DEGREE), length, turning)
