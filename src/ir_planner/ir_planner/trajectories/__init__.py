"""Trajectories through given points, and given trajectories made cheaper."""

from ir_planner.trajectories.optimization import OptimizationPlan, optimize_trajectory
from ir_planner.trajectories.through_points import POINTS_MAX, Reference, plan_through
from ir_planner.trajectories.via import Via, plan_via, search_via

__all__ = [
    "POINTS_MAX",
    "OptimizationPlan",
    "Reference",
    "Via",
    "optimize_trajectory",
    "plan_through",
    "plan_via",
    "search_via",
]
