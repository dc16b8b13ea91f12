"""What a request may choose, checked once: zero is a value, NaN is none, an unknown choice lists the known."""

import math
from dataclasses import dataclass

from ir_msgs_py.status import StatusCode

from ir_planner.errors import RequestError

OBJECTIVES = ("movement_cost", "time", "energy", "time_and_energy")
TIMINGS = ("synchronous", "asynchronous")
PLANNERS = ("", "direct", "detours", "tree")
SAFETY_DISTANCE_MAX = 1.0  # m
DURATION_MAX = 3600.0  # s
TIME_VALUE_MAX = 1e6  # W


def bounded(value: float, low: float, high: float, name: str, unit: str = "", *, open_low: bool = False) -> float:
    """The value as a float within [low, high], or (low, high]; else RequestError with value, bound and unit."""
    number = float(value)
    suffix = f" {unit}" if unit else ""
    if not math.isfinite(number):
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, f"{name} is {number}{suffix}: it must be finite")
    if number > high or number < low or (open_low and number == low):
        left = "(" if open_low else "["
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"{name} is {number:g}{suffix}: it must be in {left}{low:g}, {high:g}]{suffix}",
        )
    return number


def chosen(value: str, known: tuple[str, ...], name: str) -> str:
    """The choice; an unknown one lists the known."""
    if value not in known:
        listed = ", ".join(word or '""' for word in known)
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS, f"{name} {ascii(value[:60])} is unknown: known are {listed}"
        )
    return value


@dataclass(frozen=True)
class Options:
    """Choices of a request, in the words of PlanOptions.msg, whose defaults these are.

    planner_id: which searches may be used, "" all in turn. max_iterations: certified edges, 0 = the default.
    planning_time [s]: a ceiling. safety_distance S_m [m]. time_value [W]: J = E + time_value x T. duration [s],
    0 = free. load: names joined by "+", "none", or "" for what is attached.
    """

    planner_id: str = ""
    seed: int = 0
    max_iterations: int = 0
    planning_time: float = 5.0
    safety_distance: float = 0.02
    objective: str = "time_and_energy"
    time_value: float = 500.0
    duration: float = 0.0
    timing: str = "synchronous"
    velocity_scaling: float = 1.0
    acceleration_scaling: float = 1.0
    load: str = ""
    include_points: bool = False

    def __post_init__(self) -> None:
        chosen(self.planner_id, PLANNERS, "planner_id")
        chosen(self.objective, OBJECTIVES, "objective")
        chosen(self.timing, TIMINGS, "timing")
        if not 0 <= self.seed < 2**64:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS, f"seed is {self.seed}: it must be in [0, 18446744073709551615]"
            )
        bounded(self.planning_time, 0.0, math.inf, "planning_time", "s", open_low=True)
        checked_safety_distance(self.safety_distance)
        bounded(self.time_value, 0.0, TIME_VALUE_MAX, "time_value", "W")
        bounded(self.duration, 0.0, DURATION_MAX, "duration", "s")
        bounded(self.velocity_scaling, 0.0, 1.0, "velocity_scaling", open_low=True)
        bounded(self.acceleration_scaling, 0.0, 1.0, "acceleration_scaling", open_low=True)


def checked_safety_distance(value: float) -> float:
    """S_m [m]: 0 is taken literally."""
    return bounded(value, 0.0, SAFETY_DISTANCE_MAX, "safety_distance", "m")
