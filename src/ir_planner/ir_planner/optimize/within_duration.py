"""Little energy in a requested duration that leaves hardly any time.

A descent at such a duration ends beyond the limits. A descent of free duration ends within them,
because its result is slowed until they hold. So the duration is left free and its price lowered:
from the fastest movement on, a second is worth less from step to step, until the movement takes all
of the time that was requested.
"""

import math
from collections.abc import Callable
from dataclasses import replace

from ir_planner.request import Context
from ir_planner.timing import DURATION_SLACK, Movement

Near = Callable[[Movement, Context], Movement | None]  # by descent from a known movement
_FIRST = 32.0  # times the robot's own price of a second, at first
_STEP = 4.0  # by so much less, or more, from step to step
_DESCENTS = 5
_ENOUGH = 0.985  # of the duration: slower would save little more than stretching does


def within_duration(fastest: Movement, context: Context, near: Near) -> Movement | None:
    """The cheapest movement found of the duration that the context requests, None where none is
    certified; fastest: one that takes at most as long.
    """
    requested = context.options.duration
    best = None
    nearest = fastest
    value = _FIRST * context.scene.cell.robot.time_value
    late = 0.0
    early = 0.0
    for _ in range(_DESCENTS):
        priced = replace(context.asking("time_and_energy").options, time_value=value)
        movement = near(nearest, replace(context, options=priced))
        duration = movement.trajectory.duration if movement is not None else float("inf")
        if movement is None or duration > requested * (1.0 + DURATION_SLACK):
            late = value
        else:
            nearest = movement
            early = value
            slower = replace(movement, context=context).stretched_by(max(requested / duration, 1.0))
            if slower.prove().certified and (best is None or slower.cost < best.cost):
                best = slower
            if duration > _ENOUGH * requested:
                break
        value = math.sqrt(late * early) if late and early else (_STEP * late or early / _STEP)
    return best
