"""Regional movements: from one free configuration to another, between machines."""

from ir_planner.regional.regional import MovementPlan, plan_regional, search_regional

__all__ = ["MovementPlan", "plan_regional", "search_regional"]
