"""What a movement will cost, in a few per cent of the work of the certified answer.

A first look at all paths says which is the cheapest; it descends further on a spline with twice the
knots. Its cost includes penalties, nothing is proved.
"""

from dataclasses import replace

import numpy as np

from ir_kernels import SplineStarts
from ir_msgs_py.arrays import FloatArray
from ir_planner.curves import UniformSpline, along_path
from ir_planner.optimize.refinement import (
    EDGES_PER_INTERVAL,
    FEWEST,
    MOST,
    SHARE_OF_WORK,
    SLOWER,
    SPACING,
    THOROUGH,
    Refinement,
    Solution,
)

FIRST_LOOK = 12  # evaluations from every path
ALONE = 30  # from a path that has no rivals
_FURTHER = replace(THOROUGH.stages[1], evaluations=140)


def first_looks(
    paths: list[FloatArray], refinement: Refinement, evaluations: int
) -> list[Solution]:
    """Coarse solutions near paths (M, n), which need not be free; in one call where all have one
    cost.
    """
    work = refinement.context.work
    options = refinement.context.options
    most = len(paths) * evaluations * MOST * EDGES_PER_INTERVAL
    begin = refinement.begun(along_path(paths[0], FEWEST, 1.0), evaluations) if paths else None
    alike = begin is not None and len(begin.kept) == 1 and options.objective != "movement_cost"
    if begin is None or not alike or most > SHARE_OF_WORK * work.left:
        return [refinement.coarse(path, evaluations) for path in paths]
    work.check()
    found = refinement.cost(begin, paths[0]).descend_along(
        paths,
        SplineStarts(SPACING, SLOWER, FEWEST, MOST, options.duration),
        evaluations=evaluations,
        tolerance=begin.stage.tolerance,
    )
    splines = [UniformSpline(each.control, each.interval) for each in found]
    for each, spline in zip(found, splines, strict=True):
        work.spend(int(np.ceil(each.evaluations * spline.intervals * EDGES_PER_INTERVAL)))
    return [begin.ended(spline, each.value) for spline, each in zip(splines, found, strict=True)]


def estimate(paths: list[FloatArray], refinement: Refinement) -> Solution:
    """The coarse solution that is cheapest, from paths (M, n), at least one, which need not be
    free.
    """
    looks = first_looks(paths, refinement, FIRST_LOOK if len(paths) > 1 else ALONE)
    k = min(range(len(looks)), key=lambda k: looks[k].cost)
    return refinement.staged(looks[k], _FURTHER, paths[k])
