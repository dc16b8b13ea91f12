"""All searches by name: what `planner_id` may be. A new search is one file, its import and one
line here; or an entry point of an installed package, in the group `ir_planner.searches`.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, is_dataclass
from types import MappingProxyType
from typing import Any, NamedTuple, cast

from ir_msgs_py.status import StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError
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

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """Raises RequestError."""
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, f"planner_id: {self.why}")


def made_search(name: str, value: Any) -> Search:
    """The search of an entry point: a frozen dataclass, or a search with other settings. Raises
    InvalidValueError.
    """
    search = value() if isinstance(value, type) else value
    find = getattr(search, "find", None)
    if not (is_dataclass(search) and callable(find)):
        raise InvalidValueError("must be a frozen dataclass with a method find")
    try:
        inspect.signature(find).bind(ends=None, space=None, seed=0)
    except TypeError as error:
        raise InvalidValueError(f"its method find takes ends, space and seed: {error}") from error
    describe(type(search))
    return cast(Search, search)


class Role(NamedTuple):
    """Turns of a search in the default portfolio, 0: none.

    first: among those for the first path, by what they cost where the straight movement collides
    (benchmarks/regional.py). explores: among those that find paths of other homotopy classes with
    another seed. costly: beside others not in their first round.
    """

    first: int = 0
    explores: int = 0
    costly: bool = False


BY_NAME = Role()
_OWN: dict[str, tuple[Search, Role]] = {
    "direct": (Direct(), Role(first=1)),
    "tree": (Tree(), Role(first=2, explores=2)),
    "detours": (Detours(), Role(first=3, explores=1)),
    "retract": (Retract(), Role(first=4)),
    "genetic": (Genetic(), Role(explores=3, costly=True)),
    "sbl": (Sbl(), BY_NAME),
    "kpiece": (Kpiece(), BY_NAME),
    "bkpiece": (Bkpiece(), BY_NAME),
    "lbkpiece": (Lbkpiece(), BY_NAME),
    "prm": (Prm(), BY_NAME),
    "rrt": (Rrt(), BY_NAME),
    "rrt_connect": (RrtConnect(), BY_NAME),
    "aorrtc": (Aorrtc(), BY_NAME),
}
SEARCHES: Registry[Search] = Registry(
    "ir_planner.searches",
    {name: search for name, (search, _) in _OWN.items()},
    made_search,
    stand_in=UnusableSearch,
    reserved=NAMES_OF_SETTINGS,
)


def role_of(name: str) -> Role:
    """The role of a search; installed packages' are asked by name only."""
    return _OWN[name][1] if name in _OWN else BY_NAME


def _in_turn(turn: Callable[[Role], int]) -> tuple[str, ...]:
    """Names of the searches that have a turn, in its order."""
    turns = {name: turn(role_of(name)) for name in _OWN}
    return tuple(sorted((name for name in _OWN if turns[name]), key=turns.__getitem__))


FIRST_SEARCHES = _in_turn(lambda role: role.first)
EXPLORERS = _in_turn(lambda role: role.explores)


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
