"""One configuration for every stop of a route: layers of those that can be entered and left, and
the cheapest chain through them.
"""

from collections.abc import Mapping

import numpy as np

from ir_planner.configurations import INTERACTION, InteractionSettings
from ir_planner.program.movements import Movements
from ir_planner.program.part_costs import CostEdges, PartCosts, TravelEdges
from ir_planner.program.request import Progress, StageError
from ir_planner.program.station_graph import (
    ACROSS,
    ENTER,
    LEAVE,
    HopPart,
    StationChain,
    StationGraph,
)
from ir_planner.program.steps import Route
from ir_planner.program.stop_nodes import StopNode, path_nodes, posture_nodes, station_nodes
from ir_planner.request import Context
from ir_planner.service import ExitSearch, ServiceLine
from ir_values.arrays import FloatArray

_DEFAULT_WORK = 8_000  # for better answers; the bounds below are of it, with more in proportion
TOLERANCE = 2e-3  # of the cost: a cheaper chain than that isn't looked for
# Movements that may be planned once there is a chain: so many, and more for each stop. Small
# programs with many chains need more per stop than large ones have time for; by W, whose bound says
# little where segments are not free, it takes more.
_PLANNED = 24
_PLANNED_PER_STOP = 8
_PLANNED_PER_STOP_BY_W = 32
# The same per stop once time or work have ended, and how many chains are looked at then.
_LATE_PER_STOP = 8
_LATE = 100


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
    edges: PartCosts = (TravelEdges if travel else CostEdges)(movements, improvement)

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
            (HopPart(hop, ACROSS, first, second), not _is_same_place(a.departure, b.arrival)),
            (HopPart(hop, ENTER, -1, second), b.enters),
        ]
        result.append([part for part, moves in parts if moves])
    return result


def _is_same_place(q: FloatArray, other: FloatArray) -> bool:
    return np.allclose(q, other, rtol=0.0, atol=1e-9)
