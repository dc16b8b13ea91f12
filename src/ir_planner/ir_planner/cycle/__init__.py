"""The cheapest steady cycle: mixed-integer linear programs, and what is made of them."""

from ir_planner.cycle.joint import (
    ArmSchedule,
    ArmWork,
    JointCycle,
    Lag,
    Zone,
    ZoneStretch,
    cheapest_joint,
    shortest_joint,
    zones_of,
)
from ir_planner.cycle.linear import LinearAnswer, LinearProgram
from ir_planner.cycle.steady import (
    UNITS_MAX,
    Curve,
    SteadyCycle,
    SteadyProblem,
    Visit,
    Wait,
    WaitMode,
    cheapest_cycle,
    fastest_cycle,
    in_turn,
    shared_among,
)

__all__ = [
    "UNITS_MAX",
    "ArmSchedule",
    "ArmWork",
    "Curve",
    "JointCycle",
    "Lag",
    "LinearAnswer",
    "LinearProgram",
    "SteadyCycle",
    "SteadyProblem",
    "Visit",
    "Wait",
    "WaitMode",
    "Zone",
    "ZoneStretch",
    "cheapest_cycle",
    "cheapest_joint",
    "fastest_cycle",
    "in_turn",
    "shared_among",
    "shortest_joint",
    "zones_of",
]
