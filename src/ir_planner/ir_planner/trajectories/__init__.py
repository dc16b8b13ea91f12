"""Trajectories through given points, and given trajectories made cheaper."""

from ir_planner.trajectories.optimization import OptimizationPlan, optimize_trajectory
from ir_planner.trajectories.through_points import POINTS_MAX, Reference, plan_through
from ir_planner.trajectories.via import Nearness, Via, ViaSearch, passed_within

__all__ = [
    "POINTS_MAX",
    "Nearness",
    "OptimizationPlan",
    "Reference",
    "Via",
    "ViaSearch",
    "optimize_trajectory",
    "passed_within",
    "plan_through",
]
