"""The last resort: two trees grow from start and goals towards each other (RRT-Connect), over certified
edges.

The search itself is compiled (`ir_kernels.search`); here it is grown in slices that are charged to the
budget, so that a request can be stopped between them.
"""

from dataclasses import dataclass

import numpy as np
from ir_kernels.search import BidirectionalTree
from ir_msgs_py.arrays import FloatArray

from ir_planner.checks import FreeSpace

_SLICE = 256  # edges between two looks at the clock, about 2 ms
_LEAST_SCALE = 0.1


def joint_scale(space: FreeSpace) -> FloatArray:
    """How much each joint (n,) counts in the distance of configurations: the root of its weight in eq. (9),
    the first one's being 1.
    """
    weights = space.scene.weights
    return np.asarray(np.maximum(np.sqrt(weights / weights[0]), _LEAST_SCALE))


@dataclass(frozen=True, eq=False)
class Meeting:
    """A free path (M, n), or None; then gap [rad]: how near the trees came, each joint by its scale."""

    path: FloatArray | None
    gap: float


def connect(start: FloatArray, goals: FloatArray, space: FreeSpace, seed: int, most: int = 2**62) -> Meeting:
    """A free path from start (n,) to one of goals (G, n), unless the budget, or `most` edges, end before one
    is found.

    Raises CancelledError when asked to stop, ir_kernels.InputError where start, or every goal, isn't free.
    """
    work = space.work
    search = BidirectionalTree(
        space.scene.collision, start, goals, space.threshold, space.low, space.high, joint_scale(space), seed
    )
    while not work.exhausted and search.edges < most:
        before = search.edges
        found = search.grow(min(_SLICE, work.max_iterations - work.iterations, most - before))
        work.spend(search.edges - before)
        if found:
            return Meeting(search.path, 0.0)
    return Meeting(None, search.gap)
