"""From where the command is onto a trajectory, without a jump.

First time > 0: a polynomial leads in until then. First time 0 at rest: the last difference (within
the start tolerance) is closed before path time starts, as slowly as is asked. First time 0 in
motion, or with a first
velocity: a polynomial bridges to the next point far enough away. A movement that is replaced by one
with a later start leads in until that start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.execution_settings import ExecutionSettings
from ir_sim_driver.motion.goal import ErrorCode
from ir_sim_driver.motion.path import Motion, Path, quintic
from ir_sim_driver.motion.rounding import rounded

_PEAK = 10.0 / math.sqrt(3.0)  # largest acceleration of a unit quintic step of unit duration
_SAME = 1e-12  # rad; what rounding leaves of a difference
AT_REST = 1e-6  # rad/s that still count as standing


@dataclass(frozen=True, eq=False)
class Route:
    """A path and the path time [s] at which its trajectory starts; the first `lead` segments are
    not the trajectory's.
    """

    path: Path
    offset: float
    lead: int


def route_onto(
    trajectory: JointTrajectory,
    now: Motion,
    acceleration_max: FloatArray,
    settings: ExecutionSettings,
    delay: float,
    share: float,
) -> Route:
    """Path from the commanded motion `now` onto and along what is executed of the trajectory.

    acceleration_max (n,) [rad/s^2]. delay [s]: until time 0 of the trajectory; a robot at rest
    waits for it.
    share: of acceleration_max, that closing the last difference may use; anything else has its time
    given. Raises TrajectoryRefusedError.
    """
    moving = bool(now.qd.any())
    first = float(trajectory.times[0]) + (delay if moving else 0.0)
    executed = rounded(trajectory, settings.blend_time)
    coefficients, durations = executed.coefficients()
    if first > 0.0:
        lead = quintic(now, _motion_at_point(executed, 0), first)
        return Route(_path([lead, coefficients], [np.array([first]), durations], now.q), 0.0, 1)
    _check_start(trajectory, now, acceleration_max, settings)
    if moving or np.abs(_motion_at_point(executed, 0).qd).max() > AT_REST:
        return _bridged(executed, now, settings.bridge_time)
    delta = np.abs(trajectory.positions[0] - now.q)
    if delta.max() <= _SAME:
        return Route(Path(coefficients, durations, trajectory.positions[0]), 0.0, 0)
    T = math.sqrt(_PEAK * float((delta / acceleration_max).max()) / share)
    still = np.zeros_like(delta)
    closing = quintic(Motion(now.q, still, still), Motion(trajectory.positions[0], still, still), T)
    return Route(_path([closing, coefficients], [np.array([T]), durations], now.q), T, 1)


def _bridged(executed: JointTrajectory, now: Motion, bridge_time: float) -> Route:
    coefficients, durations = executed.coefficients()
    if len(durations) == 0:
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            "the only point has time 0 s and the robot moves: give it a time above 0 s",
        )
    k = min(int(np.searchsorted(executed.times, bridge_time)), len(durations))
    bridge = quintic(now, _motion_at_point(executed, k), float(executed.times[k]))
    pieces = [bridge, coefficients[k:]], [executed.times[k : k + 1], durations[k:]]
    return Route(_path(*pieces, now.q), 0.0, 1)


def _path(coefficients: list[FloatArray], durations: list[FloatArray], rest: FloatArray) -> Path:
    return Path(np.concatenate(coefficients), np.concatenate(durations), rest)


def _motion_at_point(trajectory: JointTrajectory, k: int) -> Motion:
    """Motion right after point k; what a trajectory does not say comes from its own polynomial."""
    samples = trajectory.sample(trajectory.times[k : k + 1])
    last = k == len(trajectory.times_ns) - 1
    still = np.zeros(samples.q.shape[1])
    v = samples.qd[0] if trajectory.velocities is None else trajectory.velocities[k]
    a = samples.qdd[0] if trajectory.accelerations is None else trajectory.accelerations[k]
    if last:  # the robot rests there
        v = still if trajectory.velocities is None else v
        a = still if trajectory.accelerations is None else a
    return Motion(trajectory.positions[k], v, a)


def _check_start(
    trajectory: JointTrajectory,
    now: Motion,
    acceleration_max: FloatArray,
    settings: ExecutionSettings,
) -> None:
    delta = trajectory.positions[0] - now.q
    j = int(np.abs(delta).argmax())
    if abs(delta[j]) > settings.start_tolerance:
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            f"{trajectory.joint_names[j]} starts at {trajectory.positions[0, j]:.6f} rad, "
            f"{delta[j]:+.6f} rad from the commanded {now.q[j]:.6f} rad: at most "
            f"{settings.start_tolerance:g} rad (or a first time above 0 s)",
        )
    jump = _motion_at_point(trajectory, 0).qd - now.qd
    over = np.abs(jump) - settings.blend_time * acceleration_max
    j = int(over.argmax())
    if over[j] > 0.0:
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            f"{trajectory.joint_names[j]} starts with {jump[j]:+.4f} rad/s against the command: "
            "at most "
            f"{settings.blend_time * acceleration_max[j]:.4f} rad/s (or a first time above 0 s)",
        )
