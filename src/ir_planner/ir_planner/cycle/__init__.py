"""The cheapest steady cycle: mixed-integer linear programs, and what is made of them."""

from ir_planner.cycle.joint import (
    ArmSchedule,
    ArmWork,
    ExclusiveZone,
    JointCycle,
    Lag,
    ZoneStretch,
    cheapest_joint,
    shortest_joint,
    zones_of,
)
from ir_planner.cycle.linear import LinearAnswer, LinearProgram
from ir_planner.cycle.steady import (
    UNITS_MAX,
    Curve,
    ModeWait,
    SteadyCycle,
    SteadyProblem,
    Visit,
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
    "ExclusiveZone",
    "JointCycle",
    "Lag",
    "LinearAnswer",
    "LinearProgram",
    "ModeWait",
    "SteadyCycle",
    "SteadyProblem",
    "Visit",
    "WaitMode",
    "ZoneStretch",
    "cheapest_cycle",
    "cheapest_joint",
    "fastest_cycle",
    "in_turn",
    "shared_among",
    "shortest_joint",
    "zones_of",
]
