"""A movement that is known, optimised again for another value of a second: near its path, from its own time
scaling.
"""

import numpy as np

from ir_planner.curves import UniformSpline, along_motion, fewest_seconds
from ir_planner.optimize import FEWEST, MOST, QUICK, SPACING, Refinement
from ir_planner.request import Context
from ir_planner.timing import Movement


def optimised_near(known: Movement, context: Context) -> Movement | None:
    """The cheapest certified movement by descent from a known one, or that itself; None where neither is
    certified.
    """
    refinement, robot, path = Refinement(context), context.scene.cell.robot, known.path
    least = fewest_seconds(path, refinement.limits.velocity, refinement.limits.acceleration)
    count = int(np.clip(np.ceil(least / SPACING), FEWEST, MOST))
    start = along_motion(known.trajectory, count, max(known.trajectory.duration, least))
    control = np.clip(start.control, robot.position_min, robot.position_max)
    coarse = refinement.coarse_from(UniformSpline(control, start.interval), path, QUICK.coarse)
    same = Movement(path, known.trajectory, context, known.note)
    found = refinement.refined(coarse, path)
    certified = [movement for movement in (found, same) if movement is not None and movement.certified]
    return min(certified, key=lambda movement: movement.cost, default=None)
