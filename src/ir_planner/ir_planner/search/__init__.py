"""Searches for free paths between configurations: one port, one file each, one registry."""

from ir_planner.search.port import Ends, Found, Search, quick
from ir_planner.search.registry import SEARCHES, registered
from ir_planner.search.shortcuts import fewest_corners, pulled
from ir_planner.search.tree import connect, joint_scale

__all__ = [
    "SEARCHES",
    "Ends",
    "Found",
    "Search",
    "connect",
    "fewest_corners",
    "joint_scale",
    "pulled",
    "quick",
    "registered",
]
