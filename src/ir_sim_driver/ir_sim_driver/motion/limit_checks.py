"""Does a path keep the limits of position, velocity, acceleration and torque? Proved for every
instant.

Positions, velocities and accelerations are compared by the exact extremes of the polynomials,
torques by guaranteed bounds (ir_kernels): segments of a nanosecond and paths of an hour alike,
nothing is sampled.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ir_description import RobotModel
from ir_kernels import Extrema, polynomial_extrema
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.execution_settings import ExecutionSettings
from ir_sim_driver.motion.goal import ErrorCode
from ir_sim_driver.motion.path import Path


class Range(NamedTuple):
    """Smallest and largest position (n,) [rad]."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, robot: RobotModel) -> Range:
        """The robot's own."""
        return cls(robot.position_min, robot.position_max)

    def including(self, q: FloatArray) -> Range:
        """This range and q (n,): who is outside may come back, and go no farther out."""
        return Range(np.minimum(self.low, q), np.maximum(self.high, q))


class _Excess(NamedTuple):
    """The earliest instant at which a limit is exceeded most."""

    time: float
    sentence: str


def check_limits(
    coefficients: FloatArray,
    durations: FloatArray,
    start: float,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
    allowed: Range | None = None,
) -> None:
    """Raise TrajectoryRefusedError naming joint, time, value, limit and excess where a limit is
    exceeded first: of position, velocity, acceleration or torque, in this order.

    Segments (S, n, 6) with durations (S,) [s], the first at time `start` [s] of the trajectory.
    dynamics: with the present load. allowed: positions, the robot's own range unless given.
    """
    if len(durations) == 0:
        return
    with np.errstate(over="ignore", invalid="ignore"):
        if not np.isfinite(coefficients).all():
            raise TrajectoryRefusedError(
                ErrorCode.INVALID_GOAL,
                "points lie too close in time: the polynomial between them is not finite",
            )
        position, speed, change = (polynomial_extrema(coefficients, durations, k) for k in range(3))
    starts = start + np.concatenate(([0.0], np.cumsum(durations)[:-1]))
    names = robot.joint_names
    slack = 1.0 + settings.limit_slack
    allowed = allowed or Range.of(robot)
    found = [
        _position_excess(position, starts, names, allowed, settings.position_slack),
        _excess(speed, starts, names, robot.velocity_max, slack, "rad/s"),
        _excess(change, starts, names, robot.acceleration_max, slack, "rad/s^2"),
    ]
    first = next((each for each in found if each is not None), None)
    if first is None:  # bounds of torques need motions of sensible size
        first = _torque_excess(coefficients, durations, start, names, dynamics, slack)
    if first is not None:
        raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, first.sentence)


def _position_excess(
    found: Extrema, starts: FloatArray, names: Sequence[str], allowed: Range, slack: float
) -> _Excess | None:
    low = _first(~(found.minimum >= allowed.low - slack), found.time_of_minimum, starts)
    high = _first(~(found.maximum <= allowed.high + slack), found.time_of_maximum, starts)
    candidates = []
    for at, values, bounds in (
        (low, found.minimum, allowed.low),
        (high, found.maximum, allowed.high),
    ):
        if at is not None:
            time, k, j = at
            sentence = _sentence(names[j], "is at", values[k, j], float(bounds[j]), time, "rad")
            candidates.append(_Excess(time, sentence))
    return min(candidates, default=None)


def _excess(
    found: Extrema,
    starts: FloatArray,
    names: Sequence[str],
    limit: FloatArray,
    slack: float,
    unit: str,
) -> _Excess | None:
    down = -found.minimum > found.maximum
    value = np.where(down, found.minimum, found.maximum)
    when = np.where(down, found.time_of_minimum, found.time_of_maximum)
    at = _first(~(np.abs(value) <= limit * slack), when, starts)
    if at is None:
        return None
    time, k, j = at
    return _Excess(time, _sentence(names[j], "needs", value[k, j], float(limit[j]), time, unit))


def _torque_excess(
    coefficients: FloatArray,
    durations: FloatArray,
    start: float,
    names: Sequence[str],
    dynamics: DynamicsModel,
    slack: float,
) -> _Excess | None:
    bounds = dynamics.torque_bounds(coefficients, durations)
    beyond = ~(bounds.upper <= slack)  # what cannot be decided is not allowed
    if not beyond.any():
        return None
    j = int(np.where(beyond, bounds.sampled, -np.inf).argmax())
    q, qd, qdd = Path(coefficients, durations, coefficients[0, :, 0]).motion(float(bounds.time[j]))
    limit = float(dynamics.torque_limit(qd[None])[0, j])
    # by the bound: it counts friction of either sign where a joint turns, and what could not be
    # decided
    needed = dynamics.inverse_dynamics(q[None], qd[None], qdd[None])[0, j]
    torque = float(np.copysign(bounds.upper[j] * limit, needed))
    time = start + float(bounds.time[j])
    return _Excess(time, _sentence(names[j], "needs", torque, limit, time, "Nm"))


def _first(bad: BoolArray, when: FloatArray, starts: FloatArray) -> tuple[float, int, int] | None:
    """Time [s], segment and joint of the earliest instant `when` (S, n) [s from starts (S,)] that
    is bad.
    """
    if not bad.any():
        return None
    k = int(bad.any(axis=1).argmax())
    j = int(np.where(bad[k], when[k], np.inf).argmin())
    return float(starts[k] + when[k, j]), k, j


def _sentence(name: str, verb: str, value: float, bound: float, time: float, unit: str) -> str:
    excess = abs(value) - abs(bound) if verb == "needs" else abs(value - bound)
    sized = bound if value >= 0.0 or verb == "is at" else -bound
    return (
        f"{name} {verb} {value:.6g} {unit} at {time:.4f} s: the limit is {sized:.6g} {unit}, "
        f"exceeded by {excess:.3g} {unit}"
    )
