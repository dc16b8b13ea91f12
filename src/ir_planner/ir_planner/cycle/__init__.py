"""The cheapest steady cycle: mixed-integer linear programs, and what is made of them."""

from ir_planner.cycle.linear import LinearAnswer, LinearProgram
from ir_planner.cycle.steady import (
    UNITS_MAX,
    Curve,
    ModeWait,
    Node,
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
    "Curve",
    "LinearAnswer",
    "LinearProgram",
    "ModeWait",
    "Node",
    "SteadyCycle",
    "SteadyProblem",
    "Visit",
    "WaitMode",
    "cheapest_cycle",
    "fastest_cycle",
    "in_turn",
    "shared_among",
]
