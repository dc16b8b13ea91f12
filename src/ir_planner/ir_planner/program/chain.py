"""One configuration for every stop of a route: layers of those that can be entered and left, and the
cheapest chain through them.
"""

from collections.abc import Mapping

import numpy as np
from ir_msgs_py.arrays import BoolArray, FloatArray

from ir_planner.checks import FreeSpace
from ir_planner.program.movements import Movements
from ir_planner.program.request import Progress, StageError
from ir_planner.program.route import Route
from ir_planner.program.station_graph import Gap, Node, StationGraph
from ir_planner.program.stops import posture_nodes, station_nodes
from ir_planner.request import Context
from ir_planner.scene import path_cost
from ir_planner.service import ExitSearch, ServiceLine


def layers_of(
    route: Route,
    start: FloatArray,
    context: Context,
    searches: Mapping[str, ExitSearch],
    progress: Progress,
) -> list[list[Node]]:
    """Nodes of the start (n,) and of every stop. Raises StageError for a stop that has none."""
    layers = [[Node(ServiceLine(start[None]))]]
    with context.journal.stage("configurations") as notes:
        for place in range(len(route)):
            progress("configurations", place, len(route), 0.0)
            step, arriving = route.at(place).step, context.inside(route.arriving(place))
            if step.kind == "POSTURE":
                found, status = posture_nodes(step.target, arriving)
            else:
                near = layers[-1][0].outside
                at = arriving.at(step.target)
                found, status = station_nodes(at, route.leaving(place), near, searches)
            if not status.ok:
                raise StageError(status)
            layers.append(found)
        notes.append(" x ".join(str(len(layer)) for layer in layers))
    return layers


def cheapest_chain(
    layers: list[list[Node]], movements: Movements, context: Context, progress: Progress
) -> tuple[list[Node], float]:
    """The chain of least W and its W. Raises StageError where none connects the stops."""
    route = movements.route
    if not len(route):
        return [layers[0][0]], 0.0
    spaces = [
        FreeSpace.of(route.arriving(place), context.safety_distance, context.work)
        for place in range(len(route))
    ]

    def certify(place: int, q0: FloatArray, q1: FloatArray) -> BoolArray:
        return spaces[place].edges_free(q0, q1)

    def planned(place: int, first: Node, second: Node) -> float | None:
        found = movements.across(place, first, second)
        return None if found is None else path_cost(route.arriving(place).weights, found.waypoints)

    with context.journal.stage("station graph") as notes:
        gaps = [
            Gap.between(layers[place], layers[place + 1], route.arriving(place).weights)
            for place in range(len(route))
        ]
        graph = StationGraph(gaps, certify, planned)
        chosen, cost = graph.solve(lambda best: progress("station graph", 0, len(route), best))
        notes.append(f"W {cost:.0f}, {graph.settled} settled")
    if not np.isfinite(cost):
        raise StageError(movements.unreachable)
    return [layer[k] for layer, k in zip(layers, chosen, strict=True)], cost
