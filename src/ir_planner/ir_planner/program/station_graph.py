"""Which configuration at which station: the cheapest chain over stations x configurations, settled
lazily.

A hop leads from one stop to the next in three parts: leaving the first (service line), across,
entering the second. Every part starts with a lower bound of its cost. The cheapest chain is found
with what is known, its open parts are settled (to a higher bound or to their true cost), and that
repeats until the cheapest chain is settled as a whole: then it is the cheapest of all, because no
other can cost less than its bounds. Where work ends first, the cheapest settled chain is the
answer, and `bound` says what the best could still cost.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ir_values.arrays import BoolArray, FloatArray

LEAVE = "leave"
ACROSS = "across"
ENTER = "enter"


@dataclass(frozen=True, order=True)
class HopPart:
    """Part of a hop: from configuration `first` of its first stop and to `second` of its second
    one; -1: of all of them, where only the other counts.
    """

    hop: int
    kind: str
    first: int
    second: int


@dataclass(frozen=True)
class Settled:
    """A lower bound of a part's cost, or (exact) the cost itself; inf: the part is impossible.
    proved: the bound isn't only measured.
    """

    cost: float
    exact: bool
    proved: bool = True


class HopBounds:
    """Lower bounds of leaving (A,), across (A, B) and entering (B,), and which are exact. `cost`:
    with bounds that are measured, `proved`: without.
    """

    def __init__(self, leave: FloatArray, across: FloatArray, enter: FloatArray) -> None:
        self.cost = {
            LEAVE: leave.copy()[:, None],
            ACROSS: across.copy(),
            ENTER: enter.copy()[None, :],
        }
        self.proved = {kind: cost.copy() for kind, cost in self.cost.items()}
        self.exact: dict[str, BoolArray] = {
            kind: np.zeros(cost.shape, dtype=bool) for kind, cost in self.cost.items()
        }

    def bounds(self, *, proved: bool = False) -> FloatArray:
        """What is known of every pair (A, B): nothing costs less."""
        cost = self.proved if proved else self.cost
        return np.asarray(cost[LEAVE] + cost[ACROSS] + cost[ENTER])

    def nothing(self, kind: str, still: BoolArray) -> None:
        """Parts of a kind in which nothing moves cost nothing."""
        for cost in (self.cost, self.proved):
            cost[kind][still] = 0.0
        self.exact[kind][still] = True

    def settled(self) -> FloatArray:
        """Costs (A, B) of the pairs whose parts are all exact; inf: of the others."""
        exact = self.exact[LEAVE] & self.exact[ACROSS] & self.exact[ENTER]
        return np.asarray(np.where(exact, self.bounds(), np.inf))

    def take(self, part: HopPart, found: Settled) -> None:
        """Enter what was found of a part; a bound never falls."""
        at = max(part.first, 0), max(part.second, 0)
        for known in (self.cost, self.proved) if found.exact or found.proved else (self.cost,):
            cost = known[part.kind]
            cost[at] = found.cost if found.exact else max(found.cost, float(cost[at]))
        self.exact[part.kind][at] |= found.exact

    def open_parts(self, hop: int, first: int, second: int) -> list[HopPart]:
        """Parts of one pair that aren't exact yet."""
        parts = (
            HopPart(hop, LEAVE, first, -1),
            HopPart(hop, ACROSS, first, second),
            HopPart(hop, ENTER, -1, second),
        )
        return [p for p in parts if not self.exact[p.kind][max(p.first, 0), max(p.second, 0)]]


@dataclass(frozen=True)
class StationChain:
    """Index of the configuration at every stop, its cost (inf: there is none), and the least that
    any chain can cost; proved: by bounds that are proved alone.
    """

    chosen: list[int]
    cost: float
    bound: float
    proved: float

    @property
    def gap(self) -> float:
        """How far the chain can be from the best, as a share of its cost."""
        return self._above(self.bound)

    @property
    def proved_gap(self) -> float:
        """The gap by those bounds alone that are proved."""
        return self._above(self.proved)

    def _above(self, bound: float) -> float:
        if not np.isfinite(self.cost) or self.cost <= 0.0:
            return 0.0
        return max(self.cost - bound, 0.0) / self.cost


def shortest(costs: list[FloatArray]) -> tuple[list[int], float]:
    """Indices of the cheapest chain through layers with costs (A, B) between them, and its cost
    (inf: none).
    """
    total = np.zeros(len(costs[0]))
    came = []
    for cost in costs:
        through = total[:, None] + cost
        came.append(np.argmin(through, axis=0))
        total = np.min(through, axis=0)
    chosen = [int(np.argmin(total))]
    for step in reversed(came):
        chosen.append(int(step[chosen[-1]]))
    return chosen[::-1], float(np.min(total))


@dataclass
class StationGraph:
    """Hops in order. settle(parts): what was found of each, every one a higher bound or exact.

    tolerance: share of the cost by which the answer may exceed the best. may_go_on: asked while a
    settled chain is known; must_end: while none is.
    """

    hops: list[HopBounds]
    settle: Callable[[list[HopPart]], list[Settled]]
    tolerance: float = 0.0
    may_go_on: Callable[[], bool] = lambda: True
    must_end: Callable[[], bool] = lambda: False

    def solve(self, on_cost: Callable[[float], None] = lambda cost: None) -> StationChain:
        """The cheapest chain; `on_cost` gets the cost of the best chain known so far."""
        while True:
            chosen, bound = shortest([hop.bounds() for hop in self.hops])
            known, cost = shortest([hop.settled() for hop in self.hops])
            if not np.isfinite(bound) or (not np.isfinite(cost) and self.must_end()):
                return StationChain(chosen, np.inf, np.inf, np.inf)
            on_cost(cost if np.isfinite(cost) else bound)
            near = bound >= cost * (1.0 - self.tolerance)
            if np.isfinite(cost) and (near or not self.may_go_on()):
                proved = shortest([hop.bounds(proved=True) for hop in self.hops])[1]
                return StationChain(known, cost, min(bound, cost), min(proved, cost))
            parts = [
                part
                for k, hop in enumerate(self.hops)
                for part in hop.open_parts(k, chosen[k], chosen[k + 1])
            ]
            for part, found in zip(parts, self.settle(parts), strict=True):
                self.hops[part.hop].take(part, found)
