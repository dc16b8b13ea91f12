"""Bounds of what a request may choose, beyond what its value type already refuses."""

import math
from dataclasses import replace

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError

SAFETY_DISTANCE_MAX = 1.0  # m
DURATION_MIN = 1e-3  # s: shorter than any movement, and long enough for its square to be a number
DURATION_MAX = 3600.0  # s
SCALING_MIN = 1e-6
TIME_VALUE_MAX = 1e6  # W
PLANNING_TIME_MAX = 600.0  # s


def bounded(value: float, low: float, high: float, name: str, unit: str = "") -> float:
    """The value as a float within [low, high]; else RequestError with value, bound and unit."""
    number = float(value)
    suffix = f" {unit}" if unit else ""
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
    """The choice; an unknown one lists the known."""
    if value not in known:
        listed = ", ".join(word or '""' for word in known)
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"{name} {value[:60]!a} is unknown: known are {listed}",
        )
    return value


def safety_distance(value: float) -> float:
    """S_m [m]: 0 is taken literally."""
    return bounded(value, 0.0, SAFETY_DISTANCE_MAX, "safety_distance", "m")


def checked_options(options: PlanOptions) -> tuple[PlanOptions, str]:
    """The options within the planner's bounds, and a note where planning_time was capped (""
    else).
    """
    safety_distance(options.safety_distance)
    bounded(options.time_value, 0.0, TIME_VALUE_MAX, "time_value", "W")
    if options.duration != 0.0:  # 0: free
        bounded(options.duration, DURATION_MIN, DURATION_MAX, "duration", "s")
    bounded(options.velocity_scaling, SCALING_MIN, 1.0, "velocity_scaling")
    bounded(options.acceleration_scaling, SCALING_MIN, 1.0, "acceleration_scaling")
    if options.planning_time > PLANNING_TIME_MAX:
        note = f"planning_time {options.planning_time:g} s is capped to {PLANNING_TIME_MAX:g} s"
        return replace(options, planning_time=PLANNING_TIME_MAX), note
    return options, ""
