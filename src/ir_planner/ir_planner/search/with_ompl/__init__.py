"""OMPL's planners as searches: each in one file, all through one adapter, each request in its own
process.
"""

from ir_planner.search.port import Search
from ir_planner.search.with_ompl.host import charge_to, missing
from ir_planner.search.with_ompl.planners import (
    Aorrtc,
    Bkpiece,
    Kpiece,
    Lbkpiece,
    OmplSearch,
    Prm,
    Rrt,
    RrtConnect,
)

__all__ = [
    "Aorrtc",
    "Bkpiece",
    "Kpiece",
    "Lbkpiece",
    "Prm",
    "Rrt",
    "RrtConnect",
    "charge_to",
    "missing",
    "needs_ompl",
]


def needs_ompl(search: Search) -> bool:
    """Whether a search is one of OMPL's planners."""
    return isinstance(search, OmplSearch)
