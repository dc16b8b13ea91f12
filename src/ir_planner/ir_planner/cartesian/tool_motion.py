"""Bounds of the tool's motion on each segment of a trajectory, from those of its axes.

A place at the distance r from an axis moves by at most r per radian. By the chain rule a derivative
of the tool's place is a sum over axes, over pairs of them and over triples, each at most the
product of the axes' derivatives and the distance from the outermost axis of the term; with all
distances 1 it holds for its rotation.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import extremes
from ir_planner.scene import PlanningScene


@dataclass(frozen=True, eq=False)
class ToolMotion:
    """Bounds (S,) on each segment: of |p''| [m/s^2] and |p'''| [m/s^3] of the tcp's place, and of
    |R''| [rad/s^2] of its rotation, as 1 / sqrt(2) of the Frobenius norm; times (S + 1,) s.
    """

    times: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    turning: FloatArray

    def between(self, values: FloatArray, times: FloatArray) -> FloatArray:
        """The largest of values (S,) between times (M,) s and the next (M - 1,), at most a segment
        apart.
        """
        last = len(values) - 1
        first = np.clip(np.searchsorted(self.times, times[:-1], side="right") - 1, 0, last)
        second = np.clip(np.searchsorted(self.times, times[1:], side="left") - 1, 0, last)
        return np.maximum(values[first], values[np.maximum(second, first)])


def tool_motion(trajectory: JointTrajectory, scene: PlanningScene) -> ToolMotion:
    """Bounds of the tool's motion along a trajectory."""
    largest = extremes(*trajectory.coefficients())
    reach = _reach(scene)
    v, a, j = (
        np.cumsum(one, axis=1) for one in (largest.velocity, largest.acceleration, largest.jerk)
    )

    def outermost(sums: FloatArray) -> FloatArray:
        """Sums (S,) of terms times the distance from their outermost axes, from those up to each
        axis.
        """
        return np.asarray(portable.matmul(np.diff(sums, axis=1, prepend=0.0), reach))

    return ToolMotion(
        trajectory.times,
        outermost(a + v * v),
        outermost(j + 3.0 * a * v + portable.power(v, 3)),
        np.asarray(a[:, -1] + v[:, -1] ** 2),
    )


def _reach(scene: PlanningScene) -> FloatArray:
    """Farthest (n,) m that the tcp can be from each axis."""
    chain = scene.chain
    links = np.linalg.norm(chain.joint_origin[1:, :3, 3], axis=1)
    tail = np.append(links, portable.norm(chain.tcp[:3, 3]))
    return np.asarray(np.cumsum(tail[::-1])[::-1])
