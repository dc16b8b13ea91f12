"""Paths of the tool at a given speed: lines, circles, splines; all configurations, and a free
angle.
"""

from ir_planner.cartesian.place_curves import Arc, Line, arc_through
from ir_planner.cartesian.plan import (
    CartesianPlan,
    checked_path_options,
    choices_along,
    plan_path,
)
from ir_planner.cartesian.tool_path import PathRefusedError

__all__ = [
    "Arc",
    "CartesianPlan",
    "Line",
    "PathRefusedError",
    "arc_through",
    "checked_path_options",
    "choices_along",
    "plan_path",
]
