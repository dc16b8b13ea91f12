"""Movements that are known, made again for another value of a second: near the path of one, from
its own time scaling.
"""

from collections.abc import Sequence

from ir_planner import optimize
from ir_planner.request import Context
from ir_planner.timing import Movement, best_stretch, stretched


def optimised_near(known: Sequence[Movement], context: Context) -> Movement | None:
    """The cheapest certified movement by descent from known ones, at least one, or the cheapest of
    them slowed down; None where neither is certified.
    """
    found = (optimize.optimised_near_best(known, context), slowed_near(known, context))
    certified = [movement for movement in found if movement is not None and movement.certified]
    return min(certified, key=lambda movement: movement.cost, default=None)


def slowed_near(known: Sequence[Movement], context: Context) -> Movement | None:
    """The cheapest of known movements between the same ends, each slowed down evenly as far as that
    pays; None where none is certified.
    """
    slower = [_slowed(one, best_stretch(one.trajectory, context), context) for one in known]
    cheapest = sorted(slower, key=lambda movement: movement.coarse_cost)
    return next((movement for movement in cheapest if movement.certified), None)


def _slowed(one: Movement, factor: float, context: Context) -> Movement:
    """A movement slowed down for another request; what is known of it as it is stays known."""
    if factor == 1.0:
        return one.asked_by(context)
    return Movement(one.path, stretched(one.trajectory, factor), context, one.note)
