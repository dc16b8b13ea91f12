"""Little energy in a requested duration, by what a second is worth: for durations so short that a
descent at the duration itself ends beyond the limits.

A descent of free duration always ends within the limits, because its result is slowed down to them.
From the fastest movement on, a second is worth less from step to step, until the movement needs all
of the time.
"""

from collections.abc import Callable
from dataclasses import replace

from ir_planner.request import Context
from ir_planner.timing import DURATION_SLACK, Movement

Near = Callable[[Movement, Context], Movement | None]  # by descent from a known movement
# W: what a second is worth at first, and by how much less or more then
_FIRST = 16_000.0
_STEP = 4.0
_DESCENTS = 5
_ENOUGH = 0.985  # of the duration: slower would save little more than stretching does


def within_duration(fastest: Movement, context: Context, near: Near) -> Movement | None:
    """The cheapest movement found that takes the duration which the context requests, from one that
    takes at most as long; None where none is certified.
    """
    requested = context.options.duration
    best = None
    known = fastest
    value = _FIRST
    late = 0.0
    early = 0.0
    for _ in range(_DESCENTS):
        asked = replace(context.asking("time_and_energy").options, time_value=value)
        found = near(known, replace(context, options=asked))
        duration = found.trajectory.duration if found is not None else float("inf")
        if found is None or duration > requested * (1.0 + DURATION_SLACK):
            late = value
        else:
            known = found
            early = value
            slower = replace(found, context=context).stretched_by(max(requested / duration, 1.0))
            if slower.certified and (best is None or slower.cost < best.cost):
                best = slower
            if duration > _ENOUGH * requested:
                break
        value = (late * early) ** 0.5 if late and early else (_STEP * late or early / _STEP)
    return best
