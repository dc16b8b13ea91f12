"""A few paths that differ: those that pass elsewhere in their middle."""

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_planner.scene import path_cost

NEAREST_GOALS = 3  # goals that are tried by a search which takes one at a time: the rest cost more by W
PATHS = 3  # that one search answers with: more of them rarely differ in homotopy class
_DIFFERENT = 0.15  # rad: nearer than that in the middle, optimisation leads to one local minimum


def different_paths(paths: list[FloatArray], weights: FloatArray) -> list[FloatArray]:
    """The cheapest few of paths (M_k, n) by W, weights (n,), that differ in their middle waypoint."""
    chosen: list[FloatArray] = []
    for path in sorted(paths, key=lambda path: path_cost(weights, path)):
        middle = path[len(path) // 2]
        if all(np.abs(middle - other[len(other) // 2]).max() > _DIFFERENT for other in chosen):
            chosen.append(path)
        if len(chosen) == PATHS:
            break
    return chosen
