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

from ir_msgs_py.arrays import FloatArray, IntArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import extremes, natural_durations, spline_through, virtual_knots
from ir_planner.errors import TimingError
from ir_planner.scene import Dynamics, MotionLimits
from ir_planner.timing.limit_use import lasting_longer
from ir_planner.timing.ptp import torque_per_segment
from ir_planner.timing.spline_use import spline_use
from ir_planner.timing.time_law import GRID_NS, GRID_S

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
            steps = _even(steps * GRID_S * np.clip(use, 0.6, 1.7) ** 0.6)
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
