"""At the door: is this trajectory one that the robot can and may follow from here?"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ir_description import RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.errors import JointNamesError
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.execution_settings import ExecutionSettings
from ir_sim_driver.motion.goal import ErrorCode, JointTolerance, TrajectoryGoal
from ir_sim_driver.motion.lead_in import AT_REST, Route, route_onto
from ir_sim_driver.motion.limit_checks import Range, check_limits
from ir_sim_driver.motion.path import Motion
from ir_sim_driver.motion.rounding import rounded

_NS = 1e-9
_GENTLENESS = (0.25, 0.1, 0.03, 0.01, 1e-3, 1e-4)
"""Shares of the acceleration limits with which the last difference to a trajectory may be closed,
tried in turn. With the last one the torques are those of standing there and of friction.
"""
_HARMLESS = 1e-5
"""A difference [rad] that is closed whatever friction asks for: encoders leave less, and a drive
that holds the robot where the trajectory starts creeps so far (30 um at 3 m) with what it has left.
"""
_SHORT = 0.01  # share for it: over before a motor that gives all it has counts as overloaded


def check_goal(
    goal: TrajectoryGoal, joint_names: tuple[str, ...], settings: ExecutionSettings, now_ns: int
) -> TrajectoryGoal:
    """Return the goal in the robot's joint order. Raises TrajectoryRefusedError; knows nothing of
    the robot's state.
    """
    if goal.multi_dof:
        raise _invalid(f"{goal.multi_dof} multi-dof points: the robot has joints only")
    if goal.has_effort:
        raise _invalid("points carry effort: torques are the driver's business, leave them empty")
    points = len(goal.trajectory.times_ns)
    if points > settings.max_points:
        raise _invalid(f"the trajectory has {points} points: at most {settings.max_points}")
    try:
        trajectory = goal.trajectory.reordered(joint_names)
    except JointNamesError as error:
        raise TrajectoryRefusedError(ErrorCode.INVALID_JOINTS, str(error)) from error
    if trajectory.duration > settings.max_duration:
        raise _invalid(
            f"the trajectory takes {trajectory.duration:g} s: at most {settings.max_duration:g} s"
        )
    _check_stamp(goal, trajectory, settings, now_ns)
    _check_end(trajectory)
    for tolerance in (*goal.path_tolerance, *goal.goal_tolerance):
        _check_tolerance(tolerance, joint_names)
    if not (math.isfinite(goal.goal_time) and goal.goal_time >= 0.0):
        raise _invalid(f"goal_time_tolerance is {goal.goal_time:g} s: it must be at least 0 s")
    return replace(goal, trajectory=trajectory)


def check_trajectory(
    trajectory: JointTrajectory,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
) -> JointTrajectory:
    """Check every instant of a trajectory against the limits, whatever state the robot is in; what
    is executed of it.

    May take a while for long ones. Raises TrajectoryRefusedError.
    """
    _check_points(trajectory, robot, settings)
    executed = rounded(trajectory, settings.blend_time)
    with np.errstate(over="ignore", invalid="ignore"):
        coefficients, durations = executed.coefficients()
    try:
        check_limits(coefficients, durations, float(executed.times[0]), robot, dynamics, settings)
    except TrajectoryRefusedError as error:
        if executed is trajectory:
            raise
        corners = f"corners of positions alone are rounded over {settings.blend_time:g} s"
        raise _invalid(f"{error}; {corners}: give the points velocities") from error
    return executed


def checked_route(
    trajectory: JointTrajectory,
    now: Motion,
    robot: RobotModel,
    dynamics: DynamicsModel,
    settings: ExecutionSettings,
    delay: float = 0.0,
) -> Route:
    """Path from the commanded motion `now` along a trajectory that passed check_trajectory.

    Only what leads in is checked here; from outside its range a joint may come back, and go no
    farther out.
    The last difference of a robot at rest is closed as fast as its torques allow: nobody gave that
    a time. One that is _HARMLESS is never refused.
    delay [s]: until time 0 of the trajectory. Raises TrajectoryRefusedError.
    """
    allowed = Range.of(robot).including(now.q)

    def route(share: float) -> Route:
        return route_onto(trajectory, now, robot.acceleration_max, settings, delay, share)

    for share in _GENTLENESS:
        found = route(share)
        lead = slice(0, found.lead)
        coefficients = found.path.coefficients[lead]
        durations = found.path.durations[lead]
        try:
            check_limits(coefficients, durations, -found.offset, robot, dynamics, settings, allowed)
        except TrajectoryRefusedError as error:
            if found.offset == 0.0:
                raise
            refusal = error
        else:
            return found
    if np.abs(trajectory.positions[0] - now.q).max() <= _HARMLESS:
        return route(_SHORT)
    raise _invalid(
        f"{refusal}; until 0 s it goes from where it stands to the first point, however slowly: "
        "plan it again from where it stands"
    ) from refusal


def _check_points(
    trajectory: JointTrajectory, robot: RobotModel, settings: ExecutionSettings
) -> None:
    """Name the point that is outside: more use to its sender than the instant between points."""
    q = trajectory.positions
    over = np.maximum(q - robot.position_max, robot.position_min - q) > settings.position_slack
    if over.any():
        k, j = (int(i) for i in np.argwhere(over)[0])
        low = robot.position_min[j]
        high = robot.position_max[j]
        excess = max(q[k, j] - high, low - q[k, j])
        raise _invalid(
            f"point {k} joint {j} ({trajectory.joint_names[j]}) is at {q[k, j]:.6f} rad: the "
            f"limits are [{low:.6f}, {high:.6f}] rad, exceeded by {excess:.3g} rad"
        )


def _check_stamp(
    goal: TrajectoryGoal, trajectory: JointTrajectory, settings: ExecutionSettings, now_ns: int
) -> None:
    if goal.stamp_ns == 0:
        return
    delay = (goal.stamp_ns - now_ns) * _NS
    if delay + trajectory.duration < 0.0:
        raise TrajectoryRefusedError(
            ErrorCode.OLD_HEADER_TIMESTAMP,
            f"the trajectory ended {-delay - trajectory.duration:.3f} s ago by its header stamp: "
            "it must end in the future",
        )
    if delay > settings.max_delay:
        raise _invalid(
            f"the trajectory starts in {delay:.3f} s by its header stamp: at most "
            f"{settings.max_delay:g} s"
        )


def _check_end(trajectory: JointTrajectory) -> None:
    if trajectory.velocities is None:
        return
    last = trajectory.velocities[-1]
    j = int(np.abs(last).argmax())
    if abs(last[j]) > AT_REST:
        raise _invalid(
            f"point {len(trajectory.times_ns) - 1} joint {j} ({trajectory.joint_names[j]}) ends "
            f"with {last[j]:g} rad/s: the last velocity must be 0 rad/s"
        )


def _check_tolerance(tolerance: JointTolerance, joint_names: tuple[str, ...]) -> None:
    if tolerance.name not in joint_names:
        raise _invalid(
            f"tolerance for unknown joint {tolerance.name[:80]!r}: expected are "
            f"{', '.join(joint_names)}"
        )
    for what in ("position", "velocity", "acceleration"):
        value = getattr(tolerance, what)
        if not (math.isfinite(value) and (value >= 0.0 or value == -1.0)):
            raise _invalid(
                f"{what} tolerance of {tolerance.name} is {value:g}: it must be at least 0 (0: "
                "default), or -1 (unbounded)"
            )
    if tolerance.acceleration > 0.0:
        raise _invalid(
            f"acceleration tolerance of {tolerance.name} is {tolerance.acceleration:g} rad/s^2: "
            "nothing measures accelerations, it must be 0 (default) or -1 (unbounded)"
        )


def _invalid(sentence: str) -> TrajectoryRefusedError:
    return TrajectoryRefusedError(ErrorCode.INVALID_GOAL, sentence)
