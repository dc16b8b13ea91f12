"""What the axes do where the tool moves along a curve of theirs, and how much of the limits that
takes.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_planner.cartesian.joint_curve import JointCurve
from ir_planner.scene import MotionLimits, PlanningScene, lasting_longer, torque_use


@dataclass(frozen=True, eq=False)
class Driven:
    """Motion at M instants: t (M,) s, s (M,) m along the path, speed (M,) m/s; q, qd, qdd, qddd (M,
    n).
    """

    t: FloatArray
    s: FloatArray
    speed: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    qddd: FloatArray


def driven(
    curve: JointCurve, t: FloatArray, s: FloatArray, v: FloatArray, a: FloatArray, j: FloatArray
) -> Driven:
    """The axes at s (M,) with speed, acceleration and jerk (M,) along the path."""
    along = curve.at(np.clip(s, curve.begin, curve.end))
    return with_speed(along, t, s, v, a, j)


def with_speed(
    along: tuple[FloatArray, ...],
    t: FloatArray,
    s: FloatArray,
    v: FloatArray,
    a: FloatArray,
    j: FloatArray,
) -> Driven:
    """The same from q and its derivatives by s (M, n)."""
    q, first, second, third = along
    v1 = v[:, None]
    a1 = a[:, None]
    j1 = j[:, None]
    qd = first * v1
    qdd = second * (v1 * v1) + first * a1
    qddd = third * portable.power(v1, 3) + 3.0 * second * v1 * a1 + first * j1
    return Driven(t, s, v, q, qd, qdd, qddd)


def use_of(motion: Driven, limits: MotionLimits, scene: PlanningScene) -> FloatArray:
    """By what factor (M,) a motion would have to last longer; at most 1: within the limits."""
    torque = torque_use(scene.dynamics, motion.q, motion.qd, motion.qdd)
    return lasting_longer(
        limits, np.abs(motion.qd), np.abs(motion.qdd), np.abs(motion.qddd), torque
    )
