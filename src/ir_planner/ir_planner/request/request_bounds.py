"""Bounds of what a request may choose, beyond what its value type already refuses."""

import math
from dataclasses import replace

import numpy as np

from ir_description.robot import TOOL_ACCELERATION_MAX, TOOL_SPEED_MAX
from ir_msgs_py.options import NO_TILT, ROBOTS_TIME_VALUE, PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import extremes
from ir_planner.errors import RequestError
from ir_values.arrays import FloatArray

SAFETY_DISTANCE_MAX = 1.0  # m
DURATION_MIN = 1e-3  # s: shorter than any movement, and long enough for its square to be a number
DURATION_MAX = 3600.0  # s
SCALING_MIN = 1e-6
TOOL_LEAST = 1e-4  # m/s, m/s^2
TIME_VALUE_MAX = 1e6  # W
PLANNING_TIME_MAX = 600.0  # s


def bounded(value: float, low: float, high: float, name: str, unit: str = "") -> float:
    """The value as a float within [low, high]; else RequestError with value, bound and unit."""
    suffix = f" {unit}" if unit else ""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"{name} is {value!r:.60}: it must be a number in [{low:g}, {high:g}]{suffix}",
        ) from error
    if not math.isfinite(number):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS, f"{name} is {number}{suffix}: it must be finite"
        )
    if not low <= number <= high:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"{name} is {number:g}{suffix}: it must be in [{low:g}, {high:g}]{suffix}",
        )
    return number


def chosen(value: str, known: tuple[str, ...], name: str) -> str:
    """The choice; an unknown one lists the known. Raises RequestError for that."""
    if value not in known:
        listed = ", ".join(word or '""' for word in known)
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"{name} {value[:60]!a} is unknown: known are {listed}",
        )
    return value


def check_safety_distance(value: float) -> None:
    """Raise RequestError for an S_m [m] beyond its bounds; 0 is taken literally."""
    bounded(value, 0.0, SAFETY_DISTANCE_MAX, "safety_distance", "m")


def leaning_freely_only(options: PlanOptions, what: str) -> None:
    """Raise RequestError where a bound of the tool's tilt is asked for that `what` doesn't keep."""
    if options.tilt_max != NO_TILT:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"tilt_max is {options.tilt_max:g} rad: {what} doesn't keep it, leave it {NO_TILT:g}",
        )


def checked_options(options: PlanOptions) -> tuple[PlanOptions, str]:
    """The options within the planner's bounds, and a note where planning_time was capped (""
    else).
    """
    check_safety_distance(options.safety_distance)
    if options.time_value != ROBOTS_TIME_VALUE:
        bounded(options.time_value, 0.0, TIME_VALUE_MAX, "time_value", "W")
    if options.duration != 0.0:  # 0: free
        bounded(options.duration, DURATION_MIN, DURATION_MAX, "duration", "s")
    for value, most, name, unit in (
        (options.tool_speed, TOOL_SPEED_MAX, "tool_speed", "m/s"),
        (options.tool_acceleration, TOOL_ACCELERATION_MAX, "tool_acceleration", "m/s^2"),
    ):
        if value != 0.0:  # 0: as the axes allow
            bounded(value, TOOL_LEAST, most, name, unit)
    bounded(options.velocity_scaling, SCALING_MIN, 1.0, "velocity_scaling")
    bounded(options.acceleration_scaling, SCALING_MIN, 1.0, "acceleration_scaling")
    if options.planning_time > PLANNING_TIME_MAX:
        note = f"planning_time {options.planning_time:g} s is capped to {PLANNING_TIME_MAX:g} s"
        return replace(options, planning_time=PLANNING_TIME_MAX), note
    return options, ""


# Trajectories beyond these bounds are not examined: others cost hours of proofs, or overflow. The
# bounds lie far beyond what a robot does: a violation of its limits inside them is an answer, not a
# refusal.

POINTS_MAX = 10_000
POSITION_MAX = 100.0  # rad
VELOCITY_MAX = 1e4  # rad/s
ACCELERATION_MAX = 1e7  # rad/s^2
TRAVEL_MAX = 10_000.0  # rad, of all joints: of a robot at its limits in half an hour


def examinable(trajectory: JointTrajectory) -> JointTrajectory:
    """The trajectory, where its points and the motion between them are in bounds; else
    RequestError.
    """
    count = len(trajectory.times_ns)
    if count > POINTS_MAX:
        raise _refused(f"the trajectory has {count} points: at most {POINTS_MAX} are taken")
    if trajectory.duration > DURATION_MAX:
        raise _refused(
            f"the trajectory takes {trajectory.duration:g} s: at most {DURATION_MAX:g} s are taken"
        )
    _check(trajectory, "position", trajectory.positions, POSITION_MAX, "rad")
    for what, values, most, unit in (
        ("velocity", trajectory.velocities, VELOCITY_MAX, "rad/s"),
        ("acceleration", trajectory.accelerations, ACCELERATION_MAX, "rad/s^2"),
    ):
        if values is not None:
            _check(trajectory, what, values, most, unit)
    if count > 1:
        _check_between(trajectory)
    return trajectory


def _check_between(trajectory: JointTrajectory) -> None:
    largest = extremes(*trajectory.coefficients())
    beyond = np.maximum(np.abs(largest.lowest), np.abs(largest.highest))
    _check(trajectory, "position between points", beyond, POSITION_MAX, "rad")
    travel = float(largest.travel.sum())
    if not travel <= TRAVEL_MAX:
        raise _refused(
            f"its joints travel {travel:g} rad together: at most {TRAVEL_MAX:g} rad are taken"
        )


def _check(
    trajectory: JointTrajectory, what: str, values: FloatArray, most: float, unit: str
) -> None:
    k, j = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    if not abs(values[k, j]) <= most:
        raise _refused(
            f"{what} of {trajectory.joint_names[j]} at point {k} is {values[k, j]:g} {unit}: "
            f"it must be within {most:g} {unit}"
        )


def _refused(sentence: str) -> RequestError:
    return RequestError(StatusCode.INVALID_MOTION_PLAN, sentence)
