"""All searches by name: what `planner_id` may be. A new search is one file, and one line here; or
an entry point of an installed package, in the group `ir_planner.searches`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from types import MappingProxyType
from typing import Any, cast

from ir_msgs_py.status import StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError
from ir_planner.request import Work
from ir_planner.search.detours import Detours, Direct, Retract
from ir_planner.search.genetic_correction import Genetic
from ir_planner.search.port import Ends, Found, Search
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
from ir_values.errors import InvalidValueError
from ir_values.extensions import Registry
from ir_values.settings import describe, setting

NAMES_OF_SETTINGS = ("transitions", "interaction", "withdrawal")
"""Prefixes of other settings of the planner, which no installed search may take."""


@dataclass(frozen=True)
class UnusableSearch:
    """Stands in for a search whose package can't be used: it refuses with the reason."""

    why: str = setting("", "Why the installed package can't be used.", read_only=True)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        """Raises RequestError."""
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, f"planner_id: {self.why}")


def made_search(name: str, value: Any) -> Search:
    """The search of an entry point: a frozen dataclass, or a search with other settings. Raises
    InvalidValueError.
    """
    search = value() if isinstance(value, type) else value
    if not (is_dataclass(search) and callable(getattr(search, "find", None))):
        raise InvalidValueError("must be a frozen dataclass with a method find")
    describe(type(search))
    return cast(Search, search)


_OWN: dict[str, Search] = {
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
SEARCHES: Registry[Search] = Registry(
    "ir_planner.searches", _OWN, made_search, stand_in=UnusableSearch, reserved=NAMES_OF_SETTINGS
)


def registered() -> Mapping[str, Search]:
    """The searches as they are registered now, with their default settings; a copy that stays as it
    is.
    """
    return MappingProxyType(dict(SEARCHES))


def not_installed(search: Search) -> str:
    """How to install what a search needs, or why its package can't be used; "" where it can."""
    if isinstance(search, UnusableSearch):
        return search.why
    return missing() if needs_ompl(search) else ""
