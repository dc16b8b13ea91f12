"""The movement over a given free path."""

from ir_msgs_py.arrays import FloatArray
from ir_planner.optimize.refinement import Refinement
from ir_planner.optimize.stages import QUICK, THOROUGH
from ir_planner.request import Context
from ir_planner.timing import Movement, distinct, straight_steps


def movement_over(path: FloatArray, context: Context) -> Movement:
    """The movement over a free path (M, n): optimised, or in straight steps where that isn't
    certified; where the joints are to take their own time, in straight steps if that serves no
    worse.

    Raises TimingError when a torque does not suffice, RequestError when the requested duration is
    too short.
    """
    if context.options.timing == "asynchronous":
        common = movement_over(path, context.with_timing("synchronous"))
        own = straight_steps(distinct(path), context)
        return own if own.certified and own.cost <= common.cost else common
    path = distinct(path)
    if len(path) > 1:
        refinement = Refinement(context)
        for effort in (
            THOROUGH,
            QUICK,
        ):  # the second ends elsewhere, where the first isn't certified
            found = refinement.refined(refinement.coarse(path, effort.coarse), path, effort)
            if found is not None and found.certified:
                return found
        refinement.check_requested()
    return straight_steps(path, context)
