"""The movement over a given free path."""

from ir_msgs_py.arrays import FloatArray
from ir_planner.optimize.refinement import Refinement
from ir_planner.optimize.stages import QUICK, THOROUGH
from ir_planner.request import Context
from ir_planner.timing import Movement, distinct, straight_steps


def movement_over(path: FloatArray, context: Context) -> Movement:
    """The movement over a free path (M, n): optimised, or in straight steps where that isn't certified or the
    joints are to take their own time.

    Raises TimingError when a torque does not suffice, RequestError when the requested duration is too short.
    """
    path = distinct(path)
    if len(path) > 1 and context.options.timing == "synchronous":
        refinement = Refinement(context)
        for effort in (THOROUGH, QUICK):  # the second ends elsewhere, where the first isn't certified
            found = refinement.refined(refinement.coarse(path, effort.coarse), path, effort)
            if found is not None and found.certified:
                return found
        refinement.check_requested()
    return straight_steps(path, context)
