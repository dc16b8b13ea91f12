"""Regional movements: from one free configuration to another, between machines."""

from ir_planner.regional.exploration import Searches
from ir_planner.regional.regional import MovementPlan, plan_regional, plan_to_goal, search_regional

__all__ = ["MovementPlan", "Searches", "plan_regional", "plan_to_goal", "search_regional"]
