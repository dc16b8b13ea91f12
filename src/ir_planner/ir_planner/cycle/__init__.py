"""The cheapest steady cycle: mixed-integer linear programs, and what is made of them."""

from ir_planner.cycle.linear import LinearAnswer, LinearProgram

__all__ = ["LinearAnswer", "LinearProgram"]
