"""Trajectories through given points, and given trajectories made cheaper."""

from ir_planner.trajectories.optimization import OptimizationPlan, optimize_trajectory
from ir_planner.trajectories.through_points import POINTS_MAX, Reference, plan_through
from ir_planner.trajectories.via import Via, ViaSearch

__all__ = [
    "POINTS_MAX",
    "OptimizationPlan",
    "Reference",
    "Via",
    "ViaSearch",
    "optimize_trajectory",
    "plan_through",
]
