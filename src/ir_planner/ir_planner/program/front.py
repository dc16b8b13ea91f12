"""A program's energy at the mains over its cycle time: every point a certified program.

All points go along the chain of the free plan, which is not the cheapest for every cycle time; a
request with a point's cycle time looks for a better one as well.
"""

import numpy as np

from ir_kernels import portable
from ir_planner.program.choice import Choice
from ir_planner.program.cycle_plan import TimedChoice, task_of
from ir_planner.program.cycle_time import shared_out
from ir_planner.program.request import Progress
from ir_planner.program.time_values import TimeValues

_FULLEST = 1.001  # of the movements' shortest time: durations are rounded to nanoseconds


def front_of(choice: Choice, count: int, standing: float, progress: Progress) -> list[TimedChoice]:
    """`count` programs from the shortest cycle time to twice the free one, shortest first;
    standing: seconds of the pauses in the program.

    Energy falls to the cheapest cycle time and rises from there, by what a second of waiting costs.
    There is none where time or work have ended.
    """
    work = choice.movements.context.work
    values = TimeValues(choice.ladder, choice.parts)
    if work.exhausted:
        return []
    values.bracket(0.0)
    shortest = values.shortest * _FULLEST
    longest = max(2.0 * values.own_seconds + standing, shortest)
    times = portable.geomspace(shortest, longest, count) if count > 1 else np.array([shortest])
    for k, seconds in enumerate(times.tolist()):
        progress("pareto front", k, count, choice.chain.cost)
        if not work.exhausted:
            values.bracket(seconds)
    front = []
    for seconds in times.tolist():  # every point from all movements that are known by now
        timed = shared_out(values, task_of(choice, seconds, standing))
        if timed is not None:
            front.append(TimedChoice(choice, timed, seconds + standing))
    return front
