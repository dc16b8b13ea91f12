"""Chains: one configuration for every stop of a route, and the cheapest of them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ir_kernels import portable
from ir_planner.checks import FreeSpace
from ir_planner.configurations import INTERACTION, InteractionSettings
from ir_planner.program.cost_bounds import MARGIN, CoarseCost, least_cost
from ir_planner.program.movements import Failure, Movements, cost_of, rates_of
from ir_planner.program.request import Progress, StageError
from ir_planner.program.station_graph import (
    ACROSS,
    ENTER,
    LEAVE,
    HopBounds,
    HopPart,
    Settled,
    StationChain,
    StationGraph,
)
from ir_planner.program.steps import Route
from ir_planner.program.stop_nodes import StopNode, path_nodes, posture_nodes, station_nodes
from ir_planner.request import Context
from ir_planner.scene import STILL, movement_cost, path_cost
from ir_planner.service import ExitSearch, ServiceLine
from ir_values.arrays import FloatArray

# What the parts of hops cost: lower bounds first, then coarse solutions, then the planner's
# movements.
#
# By J, joules or time a part's bound is what physics demands, then a coarse solution without
# obstacles less its margin, then the cost of the movement that the planner finds. By W of eq. (9)
# it is the straight segment, and exact where that is free; else the path found.

Turned = HopPart | tuple[int, str, bytes]  # what parts that cost the same have in common


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
        self._costs: dict[Turned, float] = {}
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
        for part, settled in zip(paths, self._planned(paths), strict=True):
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
            found = dict(zip(lines or parts, self._planned(lines or parts), strict=True))
            return [found.get(part, Settled(0.0, exact=False)) for part in parts]
        self._looked_at.update(fresh)
        return [
            self._coarse(part) if part in fresh else Settled(0.0, exact=False) for part in parts
        ]

    def _hurried(self, parts: list[HopPart]) -> list[Settled]:
        """Where time or work have ended: a straight segment that isn't free is none; the others are
        planned when all are free. Looking whether they are free needs no work left.
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
            return self._planned(parts)
        # says what it is that time was too short for
        self.movements.plan(blocked[:1], self.improvement)
        return [
            Settled(np.inf if part in blocked else 0.0, exact=part in blocked) for part in parts
        ]

    def _coarse(self, part: HopPart) -> Settled:
        self.movements.context.work.check()
        first, second = self.movements.ends(part)
        turned = part.hop, _turned(first), np.round(second - first, 6).tobytes()
        if turned not in self._coarse_found:  # ends that differ by the same whole turns
            self._coarse_found[turned] = self._coarse_costs[part.hop].between(first, second)
        return Settled(self._coarse_found[turned] * (1.0 - MARGIN), exact=False, proved=False)

    def _planned(self, parts: list[HopPart]) -> list[Settled]:
        """Costs of the movements; a service line that is another one turned costs what that one
        does.
        """
        turned = [self._turned(part) for part in parts]
        new = {key: part for key, part in zip(turned, parts, strict=True) if key not in self._costs}
        for key, found in zip(
            new, self.movements.plan(list(new.values()), self.improvement), strict=True
        ):
            self._costs[key] = (
                np.inf if isinstance(found, Failure) else cost_of(found.consumption, self.rates)
            )
        return [Settled(self._costs[key], exact=True) for key in turned]

    def _turned(self, part: HopPart) -> Turned:
        """The same for service lines that differ by whole turns of joints: nothing of a cost
        depends on them.
        """
        if part.kind == ACROSS:
            return part
        points = self.movements.nodes(part)[0].line.points
        return part.hop, part.kind, _turned(points)


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
        found = dict(zip(others, self._planned(others), strict=True)) if not straight else {}
        return [
            straight.get(part) or found.get(part) or Settled(0.0, exact=False) for part in parts
        ]

    def _straight(self, part: HopPart) -> Settled:
        first, second = self.movements.ends(part)
        cone = self.movements.asking(part, self.movements.context).cone
        space = replace(self._spaces[part.hop], cone=cone)
        free = space.edges_free(first[None], second[None])[0]
        if not free:
            self._blocked.add(part)
        weights = self.movements.route.arriving(part.hop).weights
        return Settled(float(movement_cost(weights, first, second)), exact=bool(free))

    def _planned(self, parts: list[HopPart]) -> list[Settled]:
        """W of the movements as they are sent: a path that was found is shortened by its
        descent.
        """
        planned = self.movements.plan(parts, self.improvement)
        costs = [
            np.inf if isinstance(found, Failure) else found.consumption.movement_cost
            for found in planned
        ]
        return [Settled(cost, exact=True) for cost in costs]


def _turned(q: FloatArray) -> bytes:
    """What configurations (..., n) have in common that differ by whole turns of joints."""
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


# One configuration for every stop of a route: layers of those that can be entered and left, and
# the cheapest chain through them.

# with the default work for better answers, and in proportion with more of it
_DEFAULT_WORK = 8_000
TOLERANCE = 2e-3  # of the cost: a cheaper chain than that isn't looked for
# movements that may be planned once there is a chain: so many besides, and for each stop; small
# programs with many chains need more per stop than large ones have time for
_PLANNED = 24
_PLANNED_PER_STOP = 8
# once time or work have ended: movements planned, and chains looked at
_LATE_PER_STOP = 8
_LATE = 100
_PLANNED_PER_STOP_BY_W = 32  # the same by W, whose bound says little where segments are not free


def layers_of(
    route: Route,
    start: FloatArray,
    context: Context,
    searches: Mapping[str, ExitSearch],
    progress: Progress,
    interaction: InteractionSettings = INTERACTION,
) -> list[list[StopNode]]:
    """Nodes of the start (n,) and of every stop; searches: for paths out of stations; interaction:
    for their configurations, where a station asks for that. Raises StageError for a stop that has
    none.
    """
    layers = [[StopNode(ServiceLine(start[None]))]]
    with context.journal.stage("configurations") as notes:
        for place in range(len(route)):
            progress("configurations", place, len(route), 0.0)
            step = route.at(place).step
            arriving = context.inside(route.arriving(place))
            if step.kind == "POSTURE":
                found, status = posture_nodes(step.target, arriving)
            elif step.kind == "PATH":
                found, status = path_nodes(arriving.at(step.target), route.leaving(place))
            else:
                near = layers[-1][0].departure
                at = arriving.at(step.target)
                found, status = station_nodes(at, route.leaving(place), near, searches, interaction)
            if not status.ok:
                raise StageError(status)
            layers.append(found)
        notes.append(" x ".join(str(len(layer)) for layer in layers))
    return layers


def cheapest_chain(movements: Movements, improvement: int, progress: Progress) -> StationChain:
    """The cheapest chain by the objective. improvement: work of each movement for better answers.

    Raises StageError where none connects the stops.
    """
    context = movements.context
    count = len(movements.route)
    if not count:
        return StationChain([0], 0.0, 0.0, 0.0)
    travel = context.options.objective == "movement_cost"
    edges = (TravelEdges if travel else CostEdges)(movements, improvement)

    effort = max(context.work.improvement / _DEFAULT_WORK, 1.0)
    most = (
        count * (3 + effort * (_PLANNED_PER_STOP_BY_W if travel else _PLANNED_PER_STOP)) + _PLANNED
    )

    late: list[int] = []  # how many movements were planned when time or work had ended

    def may_go_on() -> bool:
        return movements.planned < most and not context.work.exhausted

    def must_end() -> bool:
        if context.work.exhausted:
            late.append(movements.planned)
        return bool(late) and (
            movements.planned - late[0] > count * _LATE_PER_STOP or len(late) > _LATE
        )

    with context.journal.stage("station graph") as notes:
        graph = StationGraph(edges.hops(), edges.settle, TOLERANCE / effort, may_go_on, must_end)
        chain = graph.solve(lambda best: progress("station graph", 0, count, best))
        unit = "W" if travel else "cost"
        notes.append(
            f"{unit} {chain.cost:.0f}, at most {100 * chain.gap:.2f} % above the best chain"
            + (
                ""
                if travel
                else f" (measured bounds; {100 * chain.proved_gap:.1f} % by proved ones)"
            )
            + f"; {movements.planned} movements planned"
        )
    if not np.isfinite(chain.cost):
        raise StageError(movements.unreachable)
    return chain


def parts_of(chain: StationChain, movements: Movements) -> list[list[HopPart]]:
    """The parts of every hop along a chain that move."""
    result = []
    for hop in range(len(movements.route)):
        first = chain.chosen[hop]
        second = chain.chosen[hop + 1]
        a = movements.layers[hop][first]
        b = movements.layers[hop + 1][second]
        parts = [
            (HopPart(hop, LEAVE, first, -1), a.leaves),
            (HopPart(hop, ACROSS, first, second), not _same(a.departure, b.arrival)),
            (HopPart(hop, ENTER, -1, second), b.enters),
        ]
        result.append([part for part, moves in parts if moves])
    return result


def _same(q: FloatArray, other: FloatArray) -> bool:
    return np.allclose(q, other, rtol=0.0, atol=1e-9)
