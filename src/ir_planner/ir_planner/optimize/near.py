"""A movement that is known, optimised again for another objective, value of a second or
duration.
"""

from collections.abc import Sequence

from ir_planner.optimize.refinement import Refinement
from ir_planner.request import Context
from ir_planner.timing import Movement


def optimised_near(known: Movement, context: Context) -> Movement | None:
    """The movement by descent from a known one; None where that can't be certified."""
    return Refinement(context).near([known])


def optimised_near_best(known: Sequence[Movement], context: Context) -> Movement | None:
    """The movement by descent from that of known ones, at least one, whose coarse solution costs
    least; None where that can't be certified.
    """
    return Refinement(context).near(known)
