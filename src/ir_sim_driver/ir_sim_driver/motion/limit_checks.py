"""Does a path keep the limits of position, velocity, acceleration and torque? Sampled as it will be
executed.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ir_description import RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.execution_settings import ExecutionSettings
from ir_sim_driver.motion.goal import ErrorCode

_CHUNK = 4096
_SAMPLES_MAX = 400_000


def check_limits(
    coefficients: FloatArray,
    durations: FloatArray,
    start: float,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
    dt: float,
) -> None:
    """Raise TrajectoryRefusedError naming joint, time, value, limit and excess of the first violation.

    Segments (S, n, 6) with durations (S,) [s], the first at time `start` [s] of the trajectory. dynamics: an
    ir_kernels DynamicsModel with the present load. Samples every dt [s], coarser for paths of more than 400
    000 steps, and every point.
    """
    slack = 1.0 + settings.limit_slack
    for t, q, qd, qdd in _samples(coefficients, durations, start, dt):
        beyond = np.maximum(q - robot.position_max, robot.position_min - q)
        bound = np.where(q > robot.position_max, robot.position_max, robot.position_min)
        _refuse_first(robot, t, q, bound, beyond - settings.position_slack, beyond, "is at", "rad")
        for value, limit, unit, margin in (
            (qd, robot.velocity_max, "rad/s", slack),
            (qdd, robot.acceleration_max, "rad/s^2", slack),
        ):
            excess = np.abs(value) - limit
            _refuse_first(
                robot,
                t,
                value,
                np.broadcast_to(limit, value.shape),
                excess - limit * (margin - 1.0),
                excess,
                "needs",
                unit,
            )
        torque = dynamics.inverse_dynamics(q, qd, qdd)
        limits = dynamics.torque_limit(qd)
        excess = np.abs(torque) - limits
        _refuse_first(robot, t, torque, limits, excess - limits * (slack - 1.0), excess, "needs", "Nm")


def _samples(
    coefficients: FloatArray, durations: FloatArray, start: float, dt: float
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Times (M,), q, qd, qdd (M, n) of stretches of the path, ends of segments included."""
    dt = max(dt, float(durations.sum()) / _SAMPLES_MAX)
    for c, length in zip(coefficients, durations.tolist(), strict=True):
        count = max(2, int(np.ceil(length / dt)) + 1)
        for first in range(0, count, _CHUNK):
            t = np.linspace(0.0, length, count)[first : first + _CHUNK]
            powers = t[:, None] ** np.arange(6.0)
            once = np.zeros_like(powers)
            twice = np.zeros_like(powers)
            once[:, 1:] = np.arange(1.0, 6.0) * powers[:, :5]
            twice[:, 2:] = np.arange(2.0, 6.0) * np.arange(1.0, 5.0) * powers[:, :4]
            yield start + t, powers @ c.T, once @ c.T, twice @ c.T
        start += length


def _refuse_first(
    robot: RobotModel,
    t: FloatArray,
    value: FloatArray,
    bound: FloatArray,
    over: FloatArray,
    excess: FloatArray,
    verb: str,
    unit: str,
) -> None:
    bad = over > 0.0
    if not bad.any():
        return
    k = int(bad.any(axis=1).argmax())
    j = int(over[k].argmax())
    raise TrajectoryRefusedError(
        ErrorCode.INVALID_GOAL,
        f"{robot.joint_names[j]} {verb} {value[k, j]:.6g} {unit} at {t[k]:.4f} s: the limit is "
        f"{bound[k, j]:.6g} {unit}, "
        f"exceeded by {excess[k, j]:.3g} {unit}",
    )


def check_jumps(
    coefficients: FloatArray,
    durations: FloatArray,
    start: float,
    robot: RobotModel,
    settings: ExecutionSettings,
) -> None:
    """Velocity may jump at a point, and at the end, only by what the drives can follow at once."""
    c, T = coefficients, durations[:, None]
    if len(c) == 0:
        return
    final = c[:, :, 1] + T * (
        2.0 * c[:, :, 2] + T * (3.0 * c[:, :, 3] + T * (4.0 * c[:, :, 4] + T * 5.0 * c[:, :, 5]))
    )
    following = np.vstack((c[1:, :, 1], np.zeros(c.shape[1])))
    jump = following - final
    allowed = settings.blend_time * robot.acceleration_max
    over = np.abs(jump) - allowed
    if (over > 0.0).any():
        k = int((over > 0.0).any(axis=1).argmax())
        j = int(over[k].argmax())
        time = start + float(durations[: k + 1].sum())
        raise TrajectoryRefusedError(
            ErrorCode.INVALID_GOAL,
            f"the velocity of {robot.joint_names[j]} jumps by {jump[k, j]:+.4f} rad/s at {time:.4f} "
            "s: at most "
            f"{allowed[j]:.4f} rad/s; give the points velocities",
        )
