"""A timed path as the trajectory that is sent: so many points that the tool keeps to the path
between.
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray, IntArray
from ir_msgs_py.trajectory import NS_PER_S, JointTrajectory
from ir_planner.cartesian.timed import TimedStroke
from ir_planner.scene import MotionLimits, PlanningScene

POINT_ERROR = 1e-5  # m by which the interpolant may leave the path between points
_POINT_TURN = 1e-4  # rad
_SPEED_ERROR = 5e-4  # share of the tool's speed
_JERK_USED = 0.995  # of the limit, at most
_SPACING = 0.06  # m between the first points
_LONGEST = 0.5  # s between them
_PER_RAMP = 4
_INSIDE = np.array([0.002, 0.12, 0.31, 0.5, 0.69, 0.88, 0.998])  # where an interval is looked at
_ROUNDS = 10
_SHORTEST_NS = 400_000


@dataclass(frozen=True, eq=False)
class SentPath:
    """The trajectory with its strokes, when each begins (K,) s, and the law's instants of its
    points (K of (P,) s).
    """

    trajectory: JointTrajectory
    strokes: tuple[TimedStroke, ...]
    begins: FloatArray
    instants: tuple[FloatArray, ...]


def sent(strokes: tuple[TimedStroke, ...], limits: MotionLimits, scene: PlanningScene) -> SentPath:
    """The strokes one after the other, at rest between them."""
    names = scene.cell.robot.joint_names
    times: list[IntArray] = []
    rows: list[tuple[FloatArray, ...]] = []
    begins = []
    instants = []
    begin_ns = 0
    for stroke in strokes:
        tau = _dense_enough(stroke, limits, scene)
        motion = stroke.at(tau)
        qd = motion.qd.copy()
        qdd = motion.qdd.copy()
        qd[[0, -1]] = qdd[[0, -1]] = 0.0
        first = 1 if times else 0
        begins.append(begin_ns / NS_PER_S)
        instants.append(tau)
        ns = begin_ns + np.rint(motion.t * NS_PER_S).astype(np.int64)
        times.append(ns[first:])
        rows.append((motion.q[first:], qd[first:], qdd[first:]))
        begin_ns = int(ns[-1])
    q, qd, qdd = (np.concatenate(column) for column in zip(*rows, strict=True))
    trajectory = JointTrajectory(names, np.concatenate(times), q, qd, qdd)
    return SentPath(trajectory, strokes, np.array(begins), tuple(instants))


def _dense_enough(stroke: TimedStroke, limits: MotionLimits, scene: PlanningScene) -> FloatArray:
    """Instants (P,) s of a stroke's law at which points are needed."""
    tau = _first_points(stroke)
    open_ = np.ones(len(tau) - 1, dtype=bool)
    for _ in range(_ROUNDS):
        worst = np.zeros(len(open_))
        worst[open_] = _between(stroke, tau, np.flatnonzero(open_), limits, scene)
        open_ = (worst > 1.0) & (np.diff(tau) * NS_PER_S > 2 * _SHORTEST_NS)
        if not open_.any():
            break
        middle = 0.5 * (tau[:-1] + tau[1:])[open_]
        halves = np.repeat(open_, np.where(open_, 2, 1))
        tau = np.sort(np.concatenate([tau, middle]))
        open_ = halves
    return tau


def _first_points(stroke: TimedStroke) -> FloatArray:
    law = stroke.law
    rates = np.maximum(law.first, law.last)
    counts = np.ceil(np.maximum(law.duration * rates / _SPACING, law.duration / _LONGEST)).astype(
        int
    )
    counts = np.maximum(counts, np.where(law.first == law.last, 1, _PER_RAMP))
    inner = [
        np.linspace(begin, end, count + 1)[:-1]
        for begin, end, count in zip(law.times[:-1], law.times[1:], counts, strict=True)
    ]
    return np.append(np.concatenate(inner), law.total)


def _between(
    stroke: TimedStroke,
    tau: FloatArray,
    which: IntArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> FloatArray:
    """How far the interpolant leaves the stroke, or the jerk its limit, between points `which` (W,)
    and the
    next: 1 is allowed.
    """
    ends = stroke.at(tau)
    inside = tau[which, None] + _INSIDE * np.diff(tau)[which, None]
    asked = stroke.at(inside.ravel())
    trajectory = JointTrajectory(
        scene.cell.robot.joint_names,
        np.rint(ends.t * NS_PER_S).astype(np.int64),
        ends.q,
        ends.qd,
        ends.qdd,
    )
    motion = trajectory.sample(asked.t)
    off = motion.q - asked.q
    away = motion.qd - asked.qd
    jacobian = scene.chain.jacobian(asked.q)
    place, turn = (
        np.linalg.norm(np.einsum("mij,mj->mi", jacobian[:, rows], off), axis=1) for rows in _ROWS
    )
    speed = np.linalg.norm(np.einsum("mij,mj->mi", jacobian[:, :3], away), axis=1)
    top = max(float(asked.speed.max()), 1e-9)
    jerk = (np.abs(motion.qddd) / limits.jerk).max(axis=1) / _JERK_USED
    worst = np.maximum.reduce(
        [place / POINT_ERROR, turn / _POINT_TURN, speed / (_SPEED_ERROR * top), jerk]
    )
    return np.asarray(worst.reshape(len(which), -1).max(axis=1))


_ROWS = (slice(0, 3), slice(3, 6))
