"""All searches by name: what `planner_id` may be. A new search is one file, and one line here."""

from collections.abc import Mapping
from types import MappingProxyType

from ir_planner.search.detours import Detours, Direct, Retract
from ir_planner.search.genetic import Genetic
from ir_planner.search.port import Search
from ir_planner.search.sbl import Sbl
from ir_planner.search.tree import Tree
from ir_planner.search.with_ompl import (
    Aorrtc,
    Bkpiece,
    Kpiece,
    Lbkpiece,
    Prm,
    Rrt,
    RrtConnect,
    missing,
    needs_ompl,
)

SEARCHES: dict[str, Search] = {
    "direct": Direct(),
    "tree": Tree(),
    "detours": Detours(),
    "retract": Retract(),
    "genetic": Genetic(),
    "sbl": Sbl(),
    "kpiece": Kpiece(),
    "bkpiece": Bkpiece(),
    "lbkpiece": Lbkpiece(),
    "prm": Prm(),
    "rrt": Rrt(),
    "rrt_connect": RrtConnect(),
    "aorrtc": Aorrtc(),
}


def registered() -> Mapping[str, Search]:
    """The searches as they are registered now, with their default settings; a copy that stays as it
    is.
    """
    return MappingProxyType(dict(SEARCHES))


def not_installed(search: Search) -> str:
    """How to install what a search needs; "" where it is there."""
    return missing() if needs_ompl(search) else ""
