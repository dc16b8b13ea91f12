"""The port of a search for free paths: what it is asked, what it answers, and what it may cost.

A search is a frozen dataclass whose fields are its settings (`ir_values.settings.setting`).
Registered under a name (registry.py) it is accepted as `planner_id`, its settings are ROS
parameters under that name, and the documentation lists it.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from ir_planner.checks import FreeSpace
from ir_values.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Ends:
    """start (n,), goals (G, n): configurations of one pose, cheapest by W from the start first."""

    start: FloatArray
    goals: FloatArray


class Stretch(NamedTuple):
    """A stretch that collided, between its free ends begin and end (n,), and the fitness of the
    best individual of every generation that was bred for it; the straight stretch's cost counts 1.
    """

    begin: FloatArray
    end: FloatArray
    fitness: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Correction:
    """Paths (M_k, n) of certified straight steps, cheapest by W first.

    Without one: the best individual of a stretch that was given up lacked `shortfall` m of what
    pair `pair` must keep, at `q` (n,); pair -1: there was none. generations: of all populations
    together. stretches: those that were corrected, in order.
    """

    paths: list[FloatArray]
    shortfall: float
    pair: int
    q: FloatArray
    generations: int
    stretches: tuple[Stretch, ...] = ()


@dataclass(frozen=True, eq=False)
class Found:
    """Free paths (M_k, n) of straight joint steps from the start to any of the goals, cheapest by W
    first; `note`: how near a search came that found none. correction: what was corrected on a
    straight movement.
    """

    paths: list[FloatArray]
    note: str = ""
    correction: Correction | None = None


class Search(Protocol):
    """Looks for free paths."""

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """Paths whose every step `space` certifies, which charges the step to `space.work`.

        The same ends, space and seed give the same paths; a search that can't promise that has a
        class attribute `repeatable = False`, and one that heeds the cone of the space
        `keeps_upright = True`. Ends early when `space.work.exhausted`; what a search does beside
        certifying steps it charges itself. Raises CancelledError when asked to stop.
        """


@runtime_checkable
class HasQuickVariant(Protocol):
    """A search that can be asked for a first look."""

    def quick(self) -> Search:
        """The same search with little work."""


def quick(search: Search) -> Search:
    """The search with little work, where it has such a variant; else itself."""
    return search.quick() if isinstance(search, HasQuickVariant) else search


def keeps_upright(search: Search) -> bool:
    """Whether the paths of a search keep the tool in the cone of its space."""
    return bool(getattr(search, "keeps_upright", False))


def repeatable(search: Search) -> bool:
    """Whether the same question gets the same paths from the search."""
    return bool(getattr(search, "repeatable", True))
