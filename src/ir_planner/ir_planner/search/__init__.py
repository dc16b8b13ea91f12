"""Searches for free paths between configurations."""

from ir_planner.search.genetic_settings import GeneticSettings
from ir_planner.search.searches import BY_NAME_ONLY, EXPLORERS, SEARCHES, Ends
from ir_planner.search.shortcuts import fewest_corners, pulled
from ir_planner.search.tree import connect, joint_scale

__all__ = [
    "BY_NAME_ONLY",
    "EXPLORERS",
    "SEARCHES",
    "Ends",
    "GeneticSettings",
    "connect",
    "fewest_corners",
    "joint_scale",
    "pulled",
]
