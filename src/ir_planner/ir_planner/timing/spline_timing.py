"""Time for the spline of eq. (10) through given points: interval by interval, until nothing exceeds
its limit.

The first guess runs every interval at the speed limit of its fastest joint. Then each interval is
lengthened or shortened by how much of the limits it uses, and at last all of them together until
the largest use is 1. Durations are whole grid steps (even, the virtual knots halve the first and
the last).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ir_kernels import portable
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import extremes, natural_durations, spline_through, virtual_knots
from ir_planner.errors import TimingError
from ir_planner.scene import Dynamics, MotionLimits, lasting_longer, torque_use
from ir_planner.timing.jerk_limited_laws import GRID_NS, GRID_S
from ir_planner.timing.ptp import torque_per_segment
from ir_values.arrays import FloatArray, IntArray

# The use of limits by the spline of `spline_through` from rest to rest, interval by interval: for
# rounds that change the times and ask again. The accelerations at the knots follow from a
# tridiagonal system. A virtual knot halves its interval, so next to it one coefficient of the
# system vanishes. Extremes of cubics are closed forms; torque is sampled, and the trajectory that
# is made of it is proved later.

_SHARES = np.linspace(0.0, 1.0, 9)[:, None]  # of a segment, where torque is sampled


def spline_use(
    points: FloatArray, seconds: FloatArray, limits: MotionLimits, dynamics: Dynamics
) -> FloatArray:
    """By what factor each of the M-1 intervals should last longer, above 1 where a limit is
    exceeded.

    points (M, n), M >= 3, passed after `seconds` (M-1,) each.
    """
    span = np.concatenate([[0.5 * seconds[0]], seconds, [0.5 * seconds[-1]]])
    span[[1, -2]] = span[[0, -1]]
    q, qd, qdd = _knots(points, span)
    h = span[:, None]
    jerk = np.diff(qdd, axis=0) / h
    speed = np.abs(qd)
    change = np.abs(qdd)
    turning = np.zeros_like(jerk)  # speed where a joint's acceleration changes its sign
    np.divide(qdd[:-1] ** 2, 2.0 * jerk, out=turning, where=qdd[:-1] * qdd[1:] < 0.0)
    use = lasting_longer(
        limits,
        np.maximum.reduce([speed[:-1], speed[1:], np.abs(qd[:-1] - turning)]),
        np.maximum(change[:-1], change[1:]),
        np.abs(jerk),
        _torque(q, qd, qdd, jerk, h, dynamics),
    )
    result: FloatArray = use[1:-1].copy()  # the first and the last interval have two segments each
    result[0], result[-1] = max(result[0], use[0]), max(result[-1], use[-1])
    return result


def _knots(points: FloatArray, span: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """q, qd, qdd (M+2, n) at the knots of the spline whose segments last `span` (M+1,) s."""
    from scipy.linalg.lapack import dgtsv

    start = points[:1]
    goal = points[-1:]
    q = np.concatenate([start, start, points[1:-1], goal, goal])
    h = span[:, None]

    # Continuous speed at knot k: h_{k-1} a_{k-1} + 2 (h_{k-1} + h_k) a_k + h_k a_{k+1} = 6 (s_k -
    # s_{k-1}) with accelerations a and slopes s of the chords. At rest at both ends, the places of
    # the virtual knots follow from their own acceleration: q_1 = q_0 + h^2 a_1 / 6.
    slope = np.diff(q, axis=0) / h
    slope[[0, -1]] = 0.0  # what is not known of the virtual knots stands in the matrix
    slope[1] = (q[2] - q[0]) / h[1]
    slope[-2] = (q[-1] - q[-3]) / h[-2]
    diagonal = 2.0 * (span[:-1] + span[1:])
    diagonal[0] = 6.0 * span[0]
    diagonal[-1] = 6.0 * span[-1]
    beside = span[1:-1]
    lower = beside.copy()
    upper = beside.copy()
    lower[0] = 0.0
    upper[-1] = 0.0
    right = 6.0 * np.diff(slope, axis=0)
    qdd = np.zeros_like(q)
    qdd[1:-1] = dgtsv(lower, diagonal, upper, right)[3]

    q[1] += np.square(h[0]) * qdd[1] / 6.0
    q[-2] += np.square(h[-1]) * qdd[-2] / 6.0
    chords = np.diff(q, axis=0) / h
    at_begin_of_segment = chords - h * (2.0 * qdd[:-1] + qdd[1:]) / 6.0
    qd = np.zeros_like(q)
    qd[1:-1] = at_begin_of_segment[1:]
    return q, qd, qdd


def _torque(
    q: FloatArray,
    qd: FloatArray,
    qdd: FloatArray,
    jerk: FloatArray,
    h: FloatArray,
    dynamics: Dynamics,
) -> FloatArray:
    """Largest sampled share (S, n) of the torque envelope in each segment."""
    t = (h * _SHARES[:, 0])[:, :, None]
    q, qd, qdd, jerk = (x[:, None] for x in (q[:-1], qd[:-1], qdd[:-1], jerk))
    states = (
        q + t * (qd + t * (0.5 * qdd + t * jerk / 6.0)),
        qd + t * (qdd + 0.5 * t * jerk),
        qdd + t * jerk,
    )
    use = torque_use(dynamics, *(x.reshape(-1, x.shape[2]) for x in states))
    return np.asarray(use.reshape(states[0].shape).max(axis=1))


_ROUNDS = 14
_STRETCHES = 12
_LEAST_STRETCH = 5e-4  # of the first; each one is at least twice the one before
_SHORTEST = 20  # grid steps of an interval


def time_spline(
    points: FloatArray,
    joint_names: tuple[str, ...],
    limits: MotionLimits,
    dynamics: Dynamics,
    given: FloatArray | None = None,
) -> JointTrajectory:
    """Trajectory through `points` (M, n), M >= 3, within the limits; neighbouring points differ.

    `given` (M-1,) s: requested durations; their proportions are kept, and all are stretched where
    limits ask for it. Raises TimingError when a joint's torque does not suffice however slowly.
    """
    if given is None:
        steps = _even(1.5 * natural_durations(points, limits.velocity))
        for _ in range(_ROUNDS):
            use = spline_use(points, np.asarray(steps * GRID_S), limits, dynamics)
            steps = _even(steps * GRID_S * portable.power(np.clip(use, 0.6, 1.7), 0.6))
    else:
        steps = _even(given)
    for k in range(_STRETCHES):
        worst = float(spline_use(points, np.asarray(steps * GRID_S), limits, dynamics).max())
        if worst <= 1.0:
            trajectory = _spline(points, steps, joint_names)
            worst = float(_interval_use(trajectory, len(points), limits, dynamics).max())
            if worst <= 1.0:
                return trajectory
        # gravity doesn't fall with speed: for torque the factor is too small, the more the nearer
        # it comes
        steps = _even(steps * GRID_S * max(worst, 1.0 + _LEAST_STRETCH * 2**k))
    slowest = torque_per_segment(_spline(points, steps, joint_names), dynamics)
    joint = int(np.argmax(slowest.max(axis=0)))
    raise TimingError(
        f"joint {joint + 1}: its torque does not carry the load along these points", joint
    )


def _even(seconds: NDArray[np.floating[Any]]) -> IntArray:
    half = np.ceil(np.asarray(seconds) / (2 * GRID_S) - 1e-9).astype(np.int64)
    return np.maximum(2 * half, _SHORTEST)


def _spline(points: FloatArray, steps: IntArray, joint_names: tuple[str, ...]) -> JointTrajectory:
    at = np.concatenate([[0], np.cumsum(steps)])
    knots = np.rint(virtual_knots(at)).astype(np.int64)
    spline = spline_through(points, np.asarray(at * GRID_S), np.asarray(knots * GRID_S))
    return JointTrajectory(
        joint_names, knots * GRID_NS, spline.positions, spline.velocities, spline.accelerations
    )


def _interval_use(
    trajectory: JointTrajectory, points: int, limits: MotionLimits, dynamics: Dynamics
) -> FloatArray:
    """By what factor each of the M-1 intervals should be longer: above 1 where a limit is
    exceeded.
    """
    largest = extremes(*trajectory.coefficients())
    torque = torque_per_segment(trajectory, dynamics)
    use = lasting_longer(limits, largest.velocity, largest.acceleration, largest.jerk, torque)
    # segments to intervals: the first and the last interval have two segments each
    interval = np.clip(np.arange(len(use)) - 1, 0, points - 2)
    result = np.zeros(points - 1)
    np.maximum.at(result, interval, use)
    return result
