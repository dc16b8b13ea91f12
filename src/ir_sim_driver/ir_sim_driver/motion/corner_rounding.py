"""Trajectories of positions alone: lines between points, whose corners are rounded.

A line has corners that no drive can follow. What is executed is the mean of the lines over a window
w, q~(t) = 1/w int_{t-w}^{t} q(u) du: a piecewise parabola with q~' continuous and
q~'' = (q'(t) - q'(t - w)) / w. A cubic Hermite spline through its knots t_i and t_i + w is exactly
it. The window is as long as the limits of acceleration and torque need, and at least `blend_time`.

Where lines are faster than a joint may be, or the longer window passes a point farther away than
`corner_tolerance`, all times are stretched by one factor. Clients of ROS controllers that hold no
limits send such trajectories.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ir_description import RobotModel
from ir_msgs_py.trajectory import NS_PER_S, JointTrajectory
from ir_sim_driver.motion.goal import ExecutionSettings
from ir_values.arrays import FloatArray, IntArray

_APART = 100_000  # ns; between nearer knots the rounding of positions would count as acceleration
_WITHIN = 0.999  # of a limit: rounding to nanoseconds and knots left out stay within it
_ROUNDS = 40  # each makes the window, or the times, longer
SLOWEST = 10.0  # times as long as sent; more is a mistake of the sender's
SHARES = tuple(0.7**k for k in range(18))
"""Of the acceleration limits, tried in turn until the torques suffice: corners grow longer."""


@dataclass(frozen=True, eq=False)
class Rounded:
    """What is executed of positions alone.

    window [s]: of the mean. passed [rad]: how far the points are passed by, at most, any joint.
    slowed: factor of all times, 1: as sent; above SLOWEST the trajectory is the one that was sent.
    """

    trajectory: JointTrajectory
    window: float
    passed: float
    slowed: float

    def note(self, settings: ExecutionSettings) -> str:
        """What a sender should know; "" where times and corners are what is always done to them."""
        told = []
        if self.slowed > 1.0:
            told.append(f"slowed to {100.0 / self.slowed:.3g} % of the speed that was sent")
        if self.window > settings.blend_time:
            told.append(
                f"points passed by at most {self.passed:.2g} rad (corners rounded over "
                f"{self.window:.3g} s)"
            )
        return "; ".join(told)


def is_rounded(trajectory: JointTrajectory) -> bool:
    """Whether the trajectory is executed rounded: several points, positions alone."""
    return trajectory.velocities is None and len(trajectory.times_ns) > 1


def rounded(
    trajectory: JointTrajectory, robot: RobotModel, settings: ExecutionSettings, share: float = 1.0
) -> Rounded:
    """Several positions (N, n) within the robot's velocities and a share of its accelerations.

    It ends a window later. Before a first time 0 the robot rests. Before a later one the mean
    continues the first line, so that what leads in meets it in motion; where that would begin
    farther before the first point than `corner_tolerance`, the robot rests there too.
    """
    speed = np.abs(_slopes(trajectory)) / (robot.velocity_max * _WITHIN)
    slowed = max(1.0, float(speed.max()))
    most = robot.acceleration_max * _WITHIN * share
    executed = trajectory
    window = 0.0
    passed = 0.0
    for _ in range(_ROUNDS):
        if slowed > SLOWEST:  # nobody drives it
            break
        slow = _stretched(trajectory, slowed)
        moving = slow.times_ns[0] > 0
        window = _window(slow, most, settings.blend_time, moving)
        if moving and _run_up(slow, window) > settings.corner_tolerance:
            moving = False
            window = _window(slow, most, settings.blend_time, moving)
        executed = _mean(slow, window, moving)
        passed = _passed(slow, executed, window)
        if passed <= settings.corner_tolerance or window <= settings.blend_time:
            break
        slowed *= 1.01 * float(np.sqrt(passed / settings.corner_tolerance))
    return Rounded(executed, window, passed, slowed)


def _slopes(trajectory: JointTrajectory) -> FloatArray:
    """Velocities (N - 1, n) of the lines [rad/s]."""
    steps = np.diff(trajectory.times_ns) / NS_PER_S
    slopes: FloatArray = np.diff(trajectory.positions, axis=0) / steps[:, None]
    return slopes


def _stretched(trajectory: JointTrajectory, factor: float) -> JointTrajectory:
    if factor == 1.0:
        return trajectory
    times = np.ceil(trajectory.times_ns * factor).astype(np.int64)
    return JointTrajectory(trajectory.joint_names, times, trajectory.positions)


def _run_up(trajectory: JointTrajectory, window: float) -> float:
    """How far before the first point the mean over a window [s] begins in motion [rad]."""
    return 0.5 * window * float(np.abs(_slopes(trajectory)[0]).max())


def _window(trajectory: JointTrajectory, most: FloatArray, least: float, moving: bool) -> float:
    """The shortest window [s], at least `least`, over which no velocity changes by more than its
    limit `most` (n,) [rad/s^2] allows; moving: it begins in motion.
    """
    slopes = _slopes(trajectory)
    still = np.zeros((1, slopes.shape[1]))
    before = slopes[:1] if moving else still
    # velocity i holds from ends[i] to ends[i + 1] [s]: what leads in, the lines, rest
    velocities = np.concatenate((before, slopes, still))
    ends = np.concatenate(([-np.inf], trajectory.times_ns / NS_PER_S, [np.inf]))
    window = least
    for _ in range(_ROUNDS):
        needed = window
        for apart in range(1, len(velocities)):
            between = ends[apart:-1] - ends[1 : len(ends) - apart]
            near = between < window
            if not near.any():
                break
            change = np.abs(velocities[apart:] - velocities[:-apart])[near]
            needed = max(needed, float((change / most).max()))
        if needed <= window:
            break
        window = needed
    return window


def _mean(trajectory: JointTrajectory, window: float, moving: bool) -> JointTrajectory:
    """The mean of the lines over a window [s], with its velocities; moving: it begins in motion."""
    window_ns = round(window * NS_PER_S)
    given = trajectory.times_ns
    knots = np.unique(np.concatenate((given, given + window_ns)))
    first = int(given[0])
    t = (given - first) / NS_PER_S
    q = trajectory.positions
    # before it begins: at rest, or on with the speed that it begins with
    start = q[0] - (q[1] - q[0]) / t[1] * window if moving else q[0]
    t = np.concatenate(([-window], t, [t[-1] + window]))
    at = (knots - first) / NS_PER_S
    corners = np.vstack((start, q, q[-1]))
    now = _interpolated(t, corners, at)
    window_ago = _interpolated(t, corners, at - window)
    velocities = (now - window_ago) / window
    velocities[-1] = 0.0
    # q~' is a line between knots: its integral keeps neighbours consistent to the last bit
    steps = np.diff(at)[:, None] * 0.5 * (velocities[1:] + velocities[:-1])
    travelled = np.vstack((np.zeros(q.shape[1]), np.cumsum(steps, axis=0)))
    mean = 0.5 * (start + q[0]) + travelled
    mean[-1] = q[-1]
    kept = _kept_knots(knots)
    return JointTrajectory(trajectory.joint_names, knots[kept], mean[kept], velocities[kept])


def _passed(trajectory: JointTrajectory, executed: JointTrajectory, window: float) -> float:
    """How far the points between the ends are passed by [rad]: the mean is half a window late."""
    between = slice(1, -1)
    at = trajectory.times[between] + 0.5 * window
    if len(at) == 0:
        return 0.0
    return float(np.abs(executed.sample(at).q - trajectory.positions[between]).max())


def _kept_knots(knots: IntArray) -> IntArray:
    """Indices of knots (N,) [ns], ascending, that are at least _APART apart; the first and the last
    stay.
    """
    kept = [0]
    for k in range(1, len(knots) - 1):
        if knots[k] - knots[kept[-1]] >= _APART and knots[-1] - knots[k] >= _APART:
            kept.append(k)
    return np.array([*kept, len(knots) - 1])


def _interpolated(t: FloatArray, q: FloatArray, at: FloatArray) -> FloatArray:
    """Values (M, n) at times (M,) of lines through q (N, n) at t (N,)."""
    return np.stack([np.interp(at, t, column) for column in q.T], axis=1)
