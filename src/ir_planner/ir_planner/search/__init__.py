"""Searches for free paths between configurations: one port, one file each, one registry."""

from ir_planner.search.genetic_correction import correction_log
from ir_planner.search.guesses import guesses
from ir_planner.search.port import Ends, Found, Search, keeps_upright, quick, repeatable
from ir_planner.search.registry import (
    EXPLORERS,
    FIRST_SEARCHES,
    SEARCHES,
    not_installed,
    registered,
    role_of,
)
from ir_planner.search.shortcuts import fewest_corners, pulled, straight_along
from ir_planner.search.tree import connect
from ir_planner.search.variety import COARSE, EXIT, apart, at_nine_shares, first_different

__all__ = [
    "COARSE",
    "EXIT",
    "EXPLORERS",
    "FIRST_SEARCHES",
    "SEARCHES",
    "Ends",
    "Found",
    "Search",
    "apart",
    "at_nine_shares",
    "connect",
    "correction_log",
    "fewest_corners",
    "first_different",
    "guesses",
    "keeps_upright",
    "not_installed",
    "pulled",
    "quick",
    "registered",
    "repeatable",
    "role_of",
    "straight_along",
]
