"""A movement that is known, optimised again for another value of a second: near its path, from its own time
scaling.
"""

from ir_planner import optimize
from ir_planner.request import Context
from ir_planner.timing import Movement


def optimised_near(known: Movement, context: Context) -> Movement | None:
    """The cheapest certified movement by descent from a known one, or that itself; None where neither is
    certified.
    """
    same = Movement(known.path, known.trajectory, context, known.note)
    found = optimize.optimised_near(known, context)
    certified = [movement for movement in (found, same) if movement is not None and movement.certified]
    return min(certified, key=lambda movement: movement.cost, default=None)
