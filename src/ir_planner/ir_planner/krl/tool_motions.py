"""Motions of the tool as segments of a path of the cell's tcp, with the speed that the program
allows.
"""

from dataclasses import dataclass

import numpy as np

from ir_description.poses import inverse
from ir_kernels import portable
from ir_krl import Blend, Motion, Speeds, SplineBlock, Target
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import (
    CIRCLE,
    LINE,
    POSES_MAX,
    SPEED_MAX,
    SPEED_MIN,
    SPLINE,
    CartesianSegment,
)
from ir_planner.cartesian import Line
from ir_planner.curves import turn_of, turned_evenly
from ir_planner.krl.curves import tool_ends
from ir_planner.krl.geometry import Arm, tool_in_flange
from ir_planner.krl.splines import spline_poses

_SHORTEST = 1e-4  # m: shorter ones turn on the spot, they are no segment
_SAME_TOOL = 1e-6  # m, and of the rotation's entries
_EVEN = 1e-6  # rad: below, the orientation is constant


@dataclass(frozen=True, eq=False)
class ToolMotion:
    """Segments from `start` (4, 4) [m] of the tcp in the cell; corner [m]: how far around its end
    the tool
    may leave them for the next motion, 0: it passes its end exactly.
    """

    start: FloatArray
    segments: tuple[CartesianSegment, ...]
    corner: float


def tool_motion(motion: Motion, start: FloatArray, arm: Arm) -> ToolMotion | None:
    """A LIN or CIRC from the configuration `start` (n,); None for one that no segment describes: it
    turns on the spot, it leads another tool than the cell's, which turns, or its speed is out of
    bounds.
    """
    first, last, path = tool_ends(motion, start, arm)
    pieces = 1 if isinstance(path, Line) else max(int(np.ceil(abs(path.angle) / np.pi)), 1)
    share = np.linspace(0.0, 1.0, 2 * pieces + 1)
    poses = np.tile(np.eye(4), (len(share), 1, 1))
    poses[:, :3, 3] = path.at(share * path.length)
    poses[:, :3, :3] = turned_evenly(first[:3, :3], last[:3, :3], share)
    turning = float(turn_of(portable.matmul(first[:3, :3].T, last[:3, :3])))
    speed = _speed(motion.speeds, path.length, turning)
    if path.length < _SHORTEST or not _described(motion.target, turning, speed, arm):
        return None
    tcp = _in_cell(poses, motion.target, arm)
    if isinstance(path, Line):
        segments = [CartesianSegment(LINE, (tcp[-1],), speed)]
    else:
        segments = [
            CartesianSegment(CIRCLE, (tcp[k], tcp[k + 1]), speed) for k in range(1, 2 * pieces, 2)
        ]
    return ToolMotion(tcp[0], tuple(segments), _corner(motion.blend, path.length))


def tool_spline(block: SplineBlock, start: FloatArray, arm: Arm) -> ToolMotion | None:
    """A SPLINE block from the configuration `start` (n,); None where no segment describes it."""
    first = block.parts[0]
    poses = spline_poses(block, start, arm)
    length = float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())
    turns = portable.matmul(poses[:-1, :3, :3].transpose(0, 2, 1), poses[1:, :3, :3])
    turning = float(turn_of(turns).sum())
    speed = _speed(first.speeds, length, turning)
    if len(poses) > POSES_MAX or not _described(first.target, turning, speed, arm):
        return None
    tcp = _in_cell(poses, first.target, arm)
    segment = CartesianSegment(SPLINE, tuple(tcp[1:]), speed)
    return ToolMotion(tcp[0], (segment,), _corner(block.blend, length))


def _in_cell(poses: FloatArray, target: Target, arm: Arm) -> FloatArray:
    """The cell's tcp (N, 4, 4) where the target's tool has `poses` (N, 4, 4) in its base."""
    return arm.tcp(portable.matmul(target.base, poses, inverse(target.tool)))


def _described(target: Target, turning: float, speed: float, arm: Arm) -> bool:
    """Whether the cell's tcp draws what the program's tool does, at a speed that a path may
    have.
    """
    own = tool_in_flange(arm.scene.chain.tcp)
    same = turning < _EVEN or float(np.abs(target.tool - own).max()) < _SAME_TOOL
    return same and SPEED_MIN <= speed <= SPEED_MAX


def _speed(speeds: Speeds, length: float, turning: float) -> float:
    """The tool's speed [m/s], no more than lets it turn as fast as it may."""
    bound = speeds.turning * length / turning if turning > 0.0 else speeds.velocity
    return min(speeds.velocity, bound) * speeds.override


def _corner(blend: Blend | None, length: float) -> float:
    if blend is None:
        return 0.0
    return min(blend.distance if blend.distance > 0.0 else 0.5 * blend.share * length, 0.5 * length)
