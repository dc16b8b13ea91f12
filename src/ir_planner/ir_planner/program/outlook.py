"""What to expect of a program before it is planned: whether its stops can be reached at all, and
what coarse movements cost that meet nothing. That takes a small part of the work of planning it.
"""

from dataclasses import dataclass, replace

import numpy as np

from ir_msgs_py.status import Status
from ir_planner.program.chain import TOLERANCE, layers_of
from ir_planner.program.edges import CostEdges
from ir_planner.program.movements import Movements
from ir_planner.program.program import prepared
from ir_planner.program.request import ProgramRequest, StageError, nobody
from ir_planner.program.station_graph import Part, Settled, StationGraph
from ir_planner.request import Journal, Work
from ir_planner.service import exit_searches


@dataclass(frozen=True)
class Outlook:
    """status: why a stop has no configuration that can be entered and left. cost: by the objective,
    without a cycle time, of the cheapest chain of coarse movements, less their margin; inf where
    the status says why.
    """

    status: Status
    cost: float


def outlook(request: ProgramRequest, work: Work) -> Outlook:
    """The outlook of a request; its cycle time doesn't count. Raises RequestError for one without
    sense.
    """
    route, context = prepared(replace(request, cycle_time=0.0), Journal(work, request.options.seed))
    settings = request.settings
    searches = exit_searches(settings.withdrawal)
    try:
        layers = layers_of(route, request.start, context, searches, nobody, settings.interaction)
    except StageError as failed:
        return Outlook(failed.status, np.inf)
    if not len(route):
        return Outlook(Status.success(), 0.0)
    edges = CostEdges(Movements(route, layers, context, settings.searches), 0)

    def coarse(parts: list[Part]) -> list[Settled]:
        return [replace(found, exact=True) for found in edges.settle(parts)]

    return Outlook(Status.success(), StationGraph(edges.hops(), coarse, TOLERANCE).solve().cost)
