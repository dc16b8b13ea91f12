"""Paths of the tool at a given speed: lines, circles, splines; all configurations, and a free
angle.
"""

from ir_planner.cartesian.answer import CartesianPlan
from ir_planner.cartesian.choices import Choice, choices_along
from ir_planner.cartesian.places import Arc, ArcLength, Line, Through, arc_through
from ir_planner.cartesian.plan import checked_path_options, heading_status, plan_path
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.tool_path import HeadingError

__all__ = [
    "Arc",
    "ArcLength",
    "CartesianPlan",
    "Choice",
    "HeadingError",
    "Line",
    "PathRefusedError",
    "Through",
    "arc_through",
    "checked_path_options",
    "choices_along",
    "heading_status",
    "plan_path",
]
