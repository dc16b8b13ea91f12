"""A program's energy at the mains over its cycle time: every point a certified program.

All points go along the chain of the free plan, which is not the cheapest for every cycle time; `plan_program`
with a point's cycle time looks for a better one as well.
"""

import numpy as np

from ir_msgs_py.status import Status
from ir_planner.program.cycle_plan import task_of, values_of
from ir_planner.program.cycle_time import shared_out
from ir_planner.program.program import chosen_chain, cycle_of, filled, finished, prepared
from ir_planner.program.request import ProgramPlan, ProgramRequest, Progress, StageError, nobody
from ir_planner.program.time_values import FASTEST
from ir_planner.request import Journal, Work

POINTS = 9  # from the shortest to twice the free cycle time
_FULLEST = 1.001  # of the movements' shortest time: durations are rounded to nanoseconds


def plan_front(request: ProgramRequest, work: Work, progress: Progress = nobody) -> tuple[ProgramPlan, ...]:
    """Programs from the shortest cycle time to twice the free one, shortest first; a single answer with its
    status where there is no program. The request's cycle time is not used.

    Energy falls to the cheapest cycle time and rises from there, by what a second of waiting costs.
    Raises RequestError for a request that makes no sense, CancelledError when stopped.
    """
    journal = Journal(work, request.options.seed)
    route, context = prepared(request, journal)
    try:
        movements, chain, improvement = chosen_chain(request, route, context, progress)
        values = values_of(chain, movements, improvement)
    except StageError as failed:
        return (finished(request, context, failed.status, ()),)
    found = {part: points[0].movement for part, points in values.fronts().items()}
    cycle = cycle_of(request, movements, chain, found)
    free, shortest = values.own_seconds(), values.seconds(FASTEST) * _FULLEST
    front: list[ProgramPlan] = []
    for k, seconds in enumerate(np.geomspace(shortest, max(2.0 * free + cycle.standing, shortest), POINTS)):
        progress("pareto front", k, POINTS, chain.cost)
        values.bracket(float(seconds))
        timed = shared_out(values, task_of(cycle, chain, float(seconds)))
        if timed is not None:
            steps = filled(request, movements, chain, timed, float(seconds) + cycle.standing)
            front.append(finished(request, context, Status.success(), steps))
    return tuple(front)
