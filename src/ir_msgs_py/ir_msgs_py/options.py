"""Options of a planning request, with the defaults of ir_msgs/PlanOptions."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ir_values.argument_types import typed_methods
from ir_values.arrays import at_least, direction, finite, in_fraction, one_of, set_field
from ir_values.errors import InvalidValueError

OBJECTIVES = ("movement_cost", "time", "energy", "time_and_energy")
TIMINGS = ("synchronous", "asynchronous")
ROBOTS_TIME_VALUE = -1.0
"""The time_value of who leaves it to the robot: its price of a second follows from its drives."""
NO_TILT = -1.0
"""The tilt_max of who asks for none."""
TILT_MAX = math.pi
DEFAULT_SAFETY_DISTANCE = 0.02
"""The safety_distance [m] of who names none."""
UP = (0.0, 0.0, 1.0)
"""The tilt_direction of who names none."""
AS_THE_CELL_SAYS = -1.0
"""The blend of a program's request that leaves it to the cell."""


@typed_methods(InvalidValueError)
@dataclass(frozen=True, kw_only=True)
class PlanOptions:
    """Zero is a value: a seed or safety distance of 0 is taken literally.

    planner_id: "" = the node's portfolio. random_seed: draw a seed and echo it. max_iterations:
    budget in work, 0 = the node's default. planning_time: ceiling [s]. safety_distance: S_m [m].
    time_value [W] in J = energy of the drives + time_value x T, without the base load; -1: the
    robot's own. duration: wanted [s], 0 = free. velocity_scaling, acceleration_scaling in (0, 1].
    load: load text, "" = what is attached. include_points: put the points into the answer.
    tilt_max [rad]: by how much tilt_axis, (3,) in the frame of the tcp, may lean from
    tilt_direction, (3,) in the cell, at every instant of a regional or service movement; -1: as it
    likes. () is the axis that points in the direction at the start, and the direction up. Both are
    brought to length 1.
    tool_speed [m/s], tool_acceleration [m/s^2]: the most that the tcp may have, 0 = as the axes
    allow; whole_tool: every point of tool and part instead.
    """

    planner_id: str = ""
    seed: int = 0
    random_seed: bool = False
    max_iterations: int = 0
    planning_time: float = 5.0
    safety_distance: float = DEFAULT_SAFETY_DISTANCE
    objective: str = "time_and_energy"
    time_value: float = ROBOTS_TIME_VALUE
    duration: float = 0.0
    timing: str = "synchronous"
    velocity_scaling: float = 1.0
    acceleration_scaling: float = 1.0
    load: str = ""
    include_points: bool = False
    tilt_max: float = NO_TILT
    tilt_axis: tuple[float, ...] = ()
    tilt_direction: tuple[float, ...] = ()
    tool_speed: float = 0.0
    tool_acceleration: float = 0.0
    whole_tool: bool = False

    def __post_init__(self) -> None:
        for name, bound in (("seed", 2**64), ("max_iterations", 2**32)):
            if not 0 <= getattr(self, name) < bound:
                raise InvalidValueError(
                    f"{name} is {getattr(self, name)}: it must be in 0 .. {bound - 1}"
                )
        planning_time = finite(self.planning_time, "planning_time", "s")
        if planning_time <= 0.0:
            raise InvalidValueError(
                f"planning_time is {planning_time:g} s: it must be more than 0 s"
            )
        asked = [
            ("safety_distance", "m"),
            ("time_value", "W"),
            ("duration", "s"),
            ("tool_speed", "m/s"),
            ("tool_acceleration", "m/s^2"),
        ]
        if self.time_value == ROBOTS_TIME_VALUE:
            asked.remove(("time_value", "W"))
        for name, unit in asked:
            set_field(self, name, at_least(getattr(self, name), 0.0, name, unit))
        one_of(self.objective, OBJECTIVES, "objective")
        one_of(self.timing, TIMINGS, "timing")
        for name in ("velocity_scaling", "acceleration_scaling"):
            set_field(self, name, in_fraction(getattr(self, name), name))
        set_field(self, "tilt_max", tilt_value(self.tilt_max, "tilt_max"))
        for name in ("tilt_axis", "tilt_direction"):
            given = tuple(getattr(self, name))
            if given and self.tilt_max == NO_TILT:
                raise InvalidValueError(
                    f"{name} is {list(given)} without a tilt_max: give one in [0, {TILT_MAX:g}] rad"
                )
            set_field(self, name, direction(given, name) if given else ())


def tilt_value(value: float, name: str) -> float:
    """The largest tilt [rad], or NO_TILT. Raises InvalidValueError."""
    tilt = finite(value, name, "rad")
    if tilt != NO_TILT and not 0.0 <= tilt <= TILT_MAX + 1e-6:
        raise InvalidValueError(
            f"{name} is {tilt:g} rad: it must be in [0, {TILT_MAX:g}] rad, or {NO_TILT:g} for none"
        )
    return tilt
