"""Regional movements: from one free configuration to another, between machines."""

from ir_planner.regional.escape import EscapePlan, plan_escape
from ir_planner.regional.exploration import Searches
from ir_planner.regional.regional import MovementPlan, plan_to_goal, search_regional

__all__ = [
    "EscapePlan",
    "MovementPlan",
    "Searches",
    "plan_escape",
    "plan_to_goal",
    "search_regional",
]
