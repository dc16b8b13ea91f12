"""What motions draw: straight lines of the axes, and lines, arcs and splines of the tool as joint
curves.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

from ir_kernels import portable
from ir_krl import KrlMotionError, Motion
from ir_msgs_py.arrays import FloatArray
from ir_planner.cartesian import Arc, Line, arc_through
from ir_planner.curves import turn_of, turned_evenly
from ir_planner.krl.geometry import Arm

_STEP_M = 4e-3  # between samples of a tool path
_STEP_RAD = np.radians(1.0)
_SAMPLES_MIN = 17
_SAMPLES_MAX = 20_001
_JUMP = np.radians(20.0)  # of an axis between samples: the path passes a singularity
_DEGREE = 5


class Curve(Protocol):
    """A path of the axes over s in [0, 1]."""

    @property
    def length(self) -> float:
        """Of the tool's path [m]; 0 where nothing bounds the tool."""

    @property
    def turning(self) -> float:
        """Of the tool along the path [rad]."""

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q and its first three derivatives by s, (M, n) each, at s (M,)."""


@dataclass(frozen=True, eq=False)
class AxisLine:
    """A PTP: from start to end (n,) [rad]."""

    start: FloatArray
    end: FloatArray
    length: float = 0.0
    turning: float = 0.0

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q and its first three derivatives by s, (M, n) each, at s (M,)."""
        step = np.broadcast_to(self.end - self.start, (len(s), len(self.start)))
        none = np.zeros_like(step)
        return self.start + s[:, None] * step, step, none, none


@dataclass(frozen=True, eq=False)
class AxisCurve:
    """Axes as a spline over s."""

    spline: BSpline
    length: float
    turning: float

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q and its first three derivatives by s, (M, n) each, at s (M,)."""
        q, first, second, third = (np.asarray(self.spline(s, nu=k)) for k in range(4))
        return q, first, second, third


def through_axes(points: FloatArray) -> AxisCurve:
    """The spline of the axes through points (M, n), spaced by their distance."""
    steps = np.abs(np.diff(points, axis=0)).max(axis=1)
    u = np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-9))])
    u /= u[-1]
    return AxisCurve(
        portable.interpolating_spline(u, points, min(_DEGREE, len(points) - 1)), 0.0, 0.0
    )


def tool_ends(
    motion: Motion, start: FloatArray, arm: Arm
) -> tuple[FloatArray, FloatArray, Arc | Line]:
    """Where a LIN or CIRC from the configuration `start` (n,) begins and ends, poses (4, 4) of its
    tool in its base, and the places between. Raises KrlMotionError.
    """
    first = arm.tool_pose(motion.target, start)
    last, path = drawn_from(motion, first, arm)
    return first, last, path


def drawn_from(motion: Motion, first: FloatArray, arm: Arm) -> tuple[FloatArray, Arc | Line]:
    """The same from a pose (4, 4) of its tool in its base: where it ends, and the places
    between.
    """
    last = arm.pose(motion.target, first)
    if motion.keeps_orientation:
        last[:3, :3] = first[:3, :3]
    if motion.via is None:
        return last, Line(first[:3, 3], last[:3, 3])
    arc = arc_through(first[:3, 3], arm.pose(motion.via, first)[:3, 3], last[:3, 3], motion.angle)
    if arc is None:
        raise KrlMotionError("CIRC: start, auxiliary point and end lie on a line", motion.place)
    return last, arc


def tool_curve(motion: Motion, start: FloatArray, arm: Arm) -> AxisCurve:
    """A LIN or CIRC from the configuration `start` (n,). Raises KrlMotionError."""
    first, last, path = tool_ends(motion, start, arm)
    turning = float(turn_of(portable.matmul(first[:3, :3].T, last[:3, :3])))
    fine = np.ceil(max(path.length / _STEP_M, turning / _STEP_RAD)) + 1
    u = np.linspace(0.0, 1.0, int(np.clip(fine, _SAMPLES_MIN, _SAMPLES_MAX)))
    poses = np.tile(np.eye(4), (len(u), 1, 1))
    poses[:, :3, 3] = path.at(u * path.length)
    poses[:, :3, :3] = turned_evenly(first[:3, :3], last[:3, :3], u)
    q = followed(poses, motion, start, arm)
    return AxisCurve(portable.interpolating_spline(u, q, _DEGREE), path.length, turning)


def followed(poses: FloatArray, motion: Motion, start: FloatArray, arm: Arm) -> FloatArray:
    """Configurations (N, n) along tool poses (N, 4, 4), each the nearest to the one before; the
    first is `start`. Raises KrlMotionError where the path leaves the reach or an axis jumps.
    """
    q = np.empty((len(poses), len(start)))
    q[0] = start
    for k, found in enumerate(arm.configurations(poses[1:], motion.target), start=1):
        where = f"{100.0 * k / (len(poses) - 1):.0f} % along"
        if len(found) == 0:
            raise KrlMotionError(
                f"{_name(motion)}: the path leaves the reach or an axis limit {where}", motion.place
            )
        nearest = found[np.argmin(np.abs(found - q[k - 1]).max(axis=1))]
        jump = np.abs(nearest - q[k - 1])
        if jump.max() > _JUMP:
            j = int(jump.argmax())
            raise KrlMotionError(
                f"{_name(motion)}: A{j + 1} would have to jump by {np.degrees(jump[j]):.0f} deg "
                f"{where}: a singularity, or an axis limit that asks for another configuration",
                motion.place,
            )
        q[k] = nearest
    return q


def _name(motion: Motion) -> str:
    return motion.kind.upper() + (f" {motion.target.name}" if motion.target.name else "")
