"""Paths of the tool at a given speed: lines, circles, splines; all configurations, and a free angle."""

from ir_planner.cartesian.answer import CartesianPlan
from ir_planner.cartesian.places import Arc, ArcLength, Line, Through, arc_through
from ir_planner.cartesian.plan import checked_path_options, plan_path

__all__ = [
    "Arc",
    "ArcLength",
    "CartesianPlan",
    "Line",
    "Through",
    "arc_through",
    "checked_path_options",
    "plan_path",
]
