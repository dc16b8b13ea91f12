"""OMPL's planners as searches: each in one file, all through one adapter, each request in its own
process.
"""

from ir_planner.search.port import Search
from ir_planner.search.with_ompl.aorrtc import Aorrtc
from ir_planner.search.with_ompl.bkpiece import Bkpiece
from ir_planner.search.with_ompl.host import charge_to, missing
from ir_planner.search.with_ompl.kpiece import Kpiece
from ir_planner.search.with_ompl.lbkpiece import Lbkpiece
from ir_planner.search.with_ompl.ompl_search import OmplSearch
from ir_planner.search.with_ompl.prm import Prm
from ir_planner.search.with_ompl.rrt import Rrt
from ir_planner.search.with_ompl.rrt_connect import RrtConnect

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
