"""Which configuration at which station: the shortest path of eq. (9) over stations x configurations.

Each stop of a program is a layer of configurations; the cost between two of them is W. A straight movement
may collide, so costs are settled lazily: the shortest path is found with what is known, the steps on it are
certified (or a path around is planned), their true cost is entered, and the search repeats until all steps of
the shortest path are settled.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from ir_msgs_py.arrays import BoolArray, FloatArray
from numpy.typing import NDArray

from ir_planner.scene import movement_cost
from ir_planner.service import ServiceLine

UNKNOWN, STRAIGHT, BLOCKED, PLANNED, IMPOSSIBLE = range(5)
_BATCH = 12  # straight movements that are certified together: about a millisecond
_DETOUR = 1.6  # a first guess: a path around what obstructs costs this times the straight movement


@dataclass(frozen=True, eq=False)
class Node:
    """A configuration at a stop with its service line: where the arm works, and where nothing else may be
    near it (`outside`).
    """

    line: ServiceLine

    @property
    def interaction(self) -> FloatArray:
        """At the stop."""
        return self.line.interaction

    @property
    def outside(self) -> FloatArray:
        """Where regional movements start and end."""
        return self.line.outside


@dataclass
class Gap:
    """Costs (A, B) of the movements between the configurations of two stops, and what is known of each."""

    first: list[Node]
    second: list[Node]
    cost: FloatArray
    state: NDArray[np.int8]

    @staticmethod
    def between(first: list[Node], second: list[Node], weights: FloatArray) -> "Gap":
        """All straight movements, none of them settled; with W of the service lines at the second stop."""
        a = np.array([node.outside for node in first])
        b = np.array([node.outside for node in second])
        lines = [
            2.0 * float(np.abs(np.diff(node.line.points, axis=0)).sum(axis=0) @ weights) for node in second
        ]
        cost = movement_cost(weights, a[:, None, :], b[None, :, :]) + np.array(lines)
        return Gap(first, second, cost, np.full(cost.shape, UNKNOWN, dtype=np.int8))


Certify = Callable[[int, FloatArray, FloatArray], BoolArray]
Plan = Callable[[int, Node, Node], float | None]


@dataclass
class StationGraph:
    """Gaps in order. certify(gap, q0 (K, n), q1 (K, n)): which are free; plan(gap, a, b): W of a path around,
    or None.
    """

    gaps: list[Gap]
    certify: Certify
    plan: Plan
    settled: int = field(default=0)

    def shortest(self) -> tuple[list[int], float]:
        """Index of the configuration at each stop of the cheapest chain, and its cost (inf: none)."""
        cost = np.zeros(len(self.gaps[0].first))
        came = []
        for gap in self.gaps:
            through = cost[:, None] + gap.cost
            came.append(np.argmin(through, axis=0))
            cost = np.min(through, axis=0)
        chosen = [int(np.argmin(cost))]
        for step in reversed(came):
            chosen.append(int(step[chosen[-1]]))
        return chosen[::-1], float(np.min(cost))

    def solve(self, on_cost: Callable[[float], None]) -> tuple[list[int], float]:
        """Settle the shortest chain; `on_cost` gets the best cost known so far."""
        while True:
            chosen, cost = self.shortest()
            if not np.isfinite(cost):
                return chosen, cost
            on_cost(cost)
            open_gap = next(
                (
                    k
                    for k, gap in enumerate(self.gaps)
                    if gap.state[chosen[k], chosen[k + 1]] in (UNKNOWN, BLOCKED)
                ),
                None,
            )
            if open_gap is None:
                return chosen, cost
            self._settle(open_gap, chosen[open_gap], chosen[open_gap + 1])

    def _settle(self, k: int, a: int, b: int) -> None:
        gap = self.gaps[k]
        self.settled += 1
        if gap.state[a, b] == BLOCKED:
            found = self.plan(k, gap.first[a], gap.second[b])
            straight = float(gap.cost[a, b]) / _DETOUR
            gap.state[a, b] = IMPOSSIBLE if found is None else PLANNED
            gap.cost[a, b] = np.inf if found is None else max(found, straight)
            return
        rows, columns = np.nonzero(gap.state == UNKNOWN)
        order = np.argsort(gap.cost[rows, columns], kind="stable")[:_BATCH]
        pairs = {(a, b), *((int(rows[i]), int(columns[i])) for i in order)}
        listed = sorted(pairs)
        q0 = np.array([gap.first[i].outside for i, _ in listed])
        q1 = np.array([gap.second[j].outside for _, j in listed])
        for (i, j), free in zip(listed, self.certify(k, q0, q1), strict=True):
            gap.state[i, j] = STRAIGHT if free else BLOCKED
            if not free:
                gap.cost[i, j] *= _DETOUR
