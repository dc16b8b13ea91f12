"""A movement that is known, optimised again for another objective, value of a second or duration.

The descent starts from its path and its own time scaling.
"""

import numpy as np

from ir_planner.curves import UniformSpline, along_motion, fewest_seconds
from ir_planner.optimize.refinement import FEWEST, MOST, SPACING, Refinement
from ir_planner.optimize.stages import QUICK
from ir_planner.request import Context
from ir_planner.timing import Movement


def optimised_near(known: Movement, context: Context) -> Movement | None:
    """The movement by descent from a known one; None where that can't be certified."""
    refinement, robot, path = Refinement(context), context.scene.cell.robot, known.path
    least = fewest_seconds(path, refinement.limits.velocity, refinement.limits.acceleration)
    count = int(np.clip(np.ceil(least / SPACING), FEWEST, MOST))
    duration = context.options.duration or max(known.trajectory.duration, least)
    start = along_motion(known.trajectory, count, duration)
    control = np.clip(start.control, robot.position_min, robot.position_max)
    coarse = refinement.coarse_from(UniformSpline(control, start.interval), path, QUICK.coarse)
    found = refinement.refined(coarse, path)
    return found if found is not None and found.certified else None
