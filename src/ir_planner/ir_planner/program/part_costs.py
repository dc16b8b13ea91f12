"""What the parts of hops cost: lower bounds first, then coarse solutions, then the planner's
movements.

By J, joules or time a part's bound is what physics demands, then a coarse solution without
obstacles less its margin, then the cost of the movement that the planner finds. By W of eq. (9) it
is the straight segment, and exact where that is free; else the path found.
"""

from dataclasses import replace
from typing import Protocol

import numpy as np

from ir_kernels import portable
from ir_planner.checks import FreeSpace
from ir_planner.program.cost_bounds import COST_MARGIN, CoarseCost, least_cost
from ir_planner.program.movements import Failure, Movements, cost_of, rates_of
from ir_planner.program.station_graph import ACROSS, ENTER, LEAVE, HopBounds, HopPart, Settled
from ir_planner.program.steps import Route
from ir_planner.program.stop_nodes import StopNode
from ir_planner.scene import STILL, movement_cost, path_cost
from ir_values.arrays import FloatArray

PartKey = HopPart | tuple[int, str, bytes]  # what parts that cost the same have in common
NOTHING_YET = Settled(0.0, exact=False)
"""Of a part that is settled in a later turn: no cost is below this bound."""


class PartCosts(Protocol):
    """What the station graph is given of the parts of its hops."""

    def hops(self) -> list[HopBounds]:
        """All hops with lower bounds of their parts."""

    def settle(self, parts: list[HopPart]) -> list[Settled]:
        """A step more for each of these parts: a higher bound, or what it costs; NOTHING_YET for
        those whose turn is later.
        """


class CostEdges:
    """Parts by what they cost: J, joules or time."""

    def __init__(self, movements: Movements, improvement: int) -> None:
        self.movements = movements
        self.improvement = improvement
        self.rates = rates_of(movements.context)
        route = movements.route
        self._coarse_costs = [
            CoarseCost(movements.context.inside(route.arriving(hop)), self.rates)
            for hop in range(len(route))
        ]
        self._looked_at: set[HopPart] = set()
        self._costs: dict[PartKey, float] = {}
        self._coarse_found: dict[tuple[int, bytes, bytes], float] = {}

    def hops(self) -> list[HopBounds]:
        """All hops with what physics demands of their parts."""
        layers = self.movements.layers
        route = self.movements.route
        return [self._hop(hop, layers[hop], layers[hop + 1]) for hop in range(len(route))]

    def _hop(self, hop: int, first: list[StopNode], second: list[StopNode]) -> HopBounds:
        context = self.movements.context.inside(self.movements.route.arriving(hop))
        scene = context.scene
        limits = context.limits
        across = least_cost(_departures(first), _arrivals(second), scene, limits, self.rates)

        def lines(nodes: list[StopNode], *, entry: bool) -> FloatArray:
            work = np.array([node.interaction for node in nodes])
            ends = (_arrivals(nodes), work) if entry else (work, _departures(nodes))
            costs = least_cost(ends[0], ends[1], scene, limits, self.rates)
            return np.asarray(np.diagonal(costs))

        bounds = HopBounds(lines(first, entry=False), across, lines(second, entry=True))
        paths = [
            HopPart(hop, ENTER, -1, k) for k, node in enumerate(second) if node.driven is not None
        ]
        for part, settled in zip(paths, self._costs_planned(paths), strict=True):
            bounds.take(part, settled)
        return _with_standing_parts(bounds, first, second)

    def settle(self, parts: list[HopPart]) -> list[Settled]:
        """Coarse solutions of the parts that have none yet; where all have, the movements: those
        along service lines first.
        """
        if self.movements.context.work.exhausted:
            return self._hurried(parts)
        fresh = [part for part in parts if part not in self._looked_at]
        if not fresh:
            lines = [part for part in parts if part.kind != ACROSS]
            found = dict(zip(lines or parts, self._costs_planned(lines or parts), strict=True))
            return [found.get(part, NOTHING_YET) for part in parts]
        self._looked_at.update(fresh)
        return [self._coarse(part) if part in fresh else NOTHING_YET for part in parts]

    def _hurried(self, parts: list[HopPart]) -> list[Settled]:
        """Where time or work have ended: parts across whose straight segment is not free are
        impossible. Where none is so, all parts are planned. To look at segments needs no work.
        """
        route = self.movements.route
        context = self.movements.context
        blocked: list[HopPart] = []
        for part in parts:
            if part.kind == ACROSS:
                first, second = self.movements.ends(part)
                cone = self.movements.asking(part, context).cone
                scene = route.arriving(part.hop)
                space = FreeSpace.of(scene, context.safety_distance, context.work, cone=cone)
                blocked += [] if space.straight_free(first[None], second[None])[0] else [part]
        if not blocked:
            return self._costs_planned(parts)
        # says what it is that time was too short for
        self.movements.plan(blocked[:1], self.improvement)
        return [
            Settled(np.inf if part in blocked else 0.0, exact=part in blocked) for part in parts
        ]

    def _coarse(self, part: HopPart) -> Settled:
        """A bound that is measured: the coarse solution without obstacles, less its margin."""
        self.movements.context.work.check()
        first, second = self.movements.ends(part)
        key = part.hop, turn_free_bytes(first), np.round(second - first, 6).tobytes()
        if key not in self._coarse_found:  # ends that differ by the same whole turns
            self._coarse_found[key] = self._coarse_costs[part.hop].between(first, second)
        return Settled(self._coarse_found[key] * (1.0 - COST_MARGIN), exact=False, proved=False)

    def _costs_planned(self, parts: list[HopPart]) -> list[Settled]:
        """Costs of the movements. Service lines whose joints differ by whole turns cost the same:
        one of them is planned.
        """
        keys = [self._part_key(part) for part in parts]
        new = {key: part for key, part in zip(keys, parts, strict=True) if key not in self._costs}
        for key, found in zip(
            new, self.movements.plan(list(new.values()), self.improvement), strict=True
        ):
            self._costs[key] = (
                np.inf if isinstance(found, Failure) else cost_of(found.consumption, self.rates)
            )
        return [Settled(self._costs[key], exact=True) for key in keys]

    def _part_key(self, part: HopPart) -> PartKey:
        """One key for service lines whose joints differ by whole turns: these cost the same."""
        if part.kind == ACROSS:
            return part
        points = self.movements.nodes(part)[0].line.points
        return part.hop, part.kind, turn_free_bytes(points)


class TravelEdges:
    """Parts by W of eq. (9): straight segments where these are free, else the movements found."""

    def __init__(self, movements: Movements, improvement: int) -> None:
        self.movements = movements
        self.improvement = improvement
        context = movements.context
        route = movements.route
        self._spaces = [
            FreeSpace.of(route.arriving(hop), context.safety_distance, context.work)
            for hop in range(len(route))
        ]
        self._blocked: set[HopPart] = set()

    def hops(self) -> list[HopBounds]:
        """All hops with W of the straight segments and of the service lines' points."""
        layers = self.movements.layers
        route = self.movements.route
        return [self._hop(route, hop, layers[hop], layers[hop + 1]) for hop in range(len(route))]

    def _hop(
        self, route: Route, k: int, first: list[StopNode], second: list[StopNode]
    ) -> HopBounds:
        weights = route.arriving(k).weights
        leave, enter = (
            np.array([path_cost(weights, node.line.points) for node in nodes])
            for nodes in (first, second)
        )
        across = movement_cost(weights, _departures(first)[:, None], _arrivals(second)[None])
        return _with_standing_parts(HopBounds(leave, across, enter), first, second)

    def settle(self, parts: list[HopPart]) -> list[Settled]:
        """W of straight segments where they are free, which is exact; else, asked again, and of
        service lines W of the movement.
        """
        fresh = [part for part in parts if part.kind == ACROSS and part not in self._blocked]
        straight = {part: self._straight(part) for part in fresh}
        others = [part for part in parts if part not in straight]
        found = dict(zip(others, self._costs_planned(others), strict=True)) if not straight else {}
        return [straight.get(part) or found.get(part) or NOTHING_YET for part in parts]

    def _straight(self, part: HopPart) -> Settled:
        """W of the straight segment: the cost where it is free, else a bound of it."""
        first, second = self.movements.ends(part)
        cone = self.movements.asking(part, self.movements.context).cone
        space = replace(self._spaces[part.hop], cone=cone)
        free = space.edges_free(first[None], second[None])[0]
        if not free:
            self._blocked.add(part)
        weights = self.movements.route.arriving(part.hop).weights
        return Settled(float(movement_cost(weights, first, second)), exact=bool(free))

    def _costs_planned(self, parts: list[HopPart]) -> list[Settled]:
        """W of the movements as they are sent: a path that was found is shortened by its
        descent.
        """
        planned = self.movements.plan(parts, self.improvement)
        costs = [
            np.inf if isinstance(found, Failure) else found.consumption.movement_cost
            for found in planned
        ]
        return [Settled(cost, exact=True) for cost in costs]


def turn_free_bytes(q: FloatArray) -> bytes:
    """The same bytes for configurations (..., n) whose joints differ by whole turns."""
    return np.round(np.stack([portable.sin(q), portable.cos(q)]), 6).tobytes()


def _arrivals(nodes: list[StopNode]) -> FloatArray:
    return np.array([node.arrival for node in nodes])


def _departures(nodes: list[StopNode]) -> FloatArray:
    return np.array([node.departure for node in nodes])


def _with_standing_parts(
    hop: HopBounds, first: list[StopNode], second: list[StopNode]
) -> HopBounds:
    """The hop, its parts in which nothing moves known to cost nothing."""
    away = np.abs(_departures(first)[:, None] - _arrivals(second)[None]).max(axis=2)
    hop.nothing(ACROSS, away <= STILL)
    hop.nothing(LEAVE, np.array([not node.leaves for node in first])[:, None])
    hop.nothing(ENTER, np.array([not node.enters for node in second])[None, :])
    return hop
