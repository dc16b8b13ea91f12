"""Searches for free paths between configurations: one port, one file each, one registry."""

from ir_planner.search.genetic_correction import correction_log
from ir_planner.search.guesses import guesses
from ir_planner.search.port import Ends, Found, Search, keeps_upright, quick, repeatable
from ir_planner.search.registry import SEARCHES, not_installed, registered
from ir_planner.search.shortcuts import fewest_corners, pulled, straight_along
from ir_planner.search.tree import connect
from ir_planner.search.variety import COARSE, EXIT, apart, at_nine_shares, first_different

__all__ = [
    "COARSE",
    "EXIT",
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
    "straight_along",
]
