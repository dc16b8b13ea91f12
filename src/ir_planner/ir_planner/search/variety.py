"""Which paths differ enough to be two: in one homotopy class, optimisation leads to one local
minimum.

Paths are compared at a few places, by the largest difference of a joint. Where, and how much is
enough, depends on what is known of them:

    candidates of one search     at their middle waypoint  0.15 rad   (MIDDLE)
    paths of the genetic search  along their whole length  a setting  (evenly)
    coarse solutions             at nine shares of length  0.12 rad   (COARSE)
    exit paths of a station      where they end            0.10 rad   (EXIT)

Coarse solutions come nearer to each other in a descent; exit paths start together.
"""

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from ir_planner.curves import at_shares, evenly_spaced
from ir_planner.scene import path_cost
from ir_values.arrays import FloatArray

T = TypeVar("T")
# goals that are tried by a search which takes one at a time: the rest cost more by W
NEAREST_GOALS = 3
PATHS = 3  # that one search answers with: more of them rarely differ in homotopy class
# rad
MIDDLE = 0.15
COARSE = 0.12
EXIT = 0.1
_NINE = np.linspace(0.1, 0.9, 9)
_EVENLY = 16


def apart(a: FloatArray, b: FloatArray) -> float:
    """Largest difference of a joint [rad] between configurations (K, n) or (n,) of two paths."""
    return float(np.abs(a - b).max())


def first_different(
    paths: Iterable[T], most: int, enough: float, places: Callable[[T], FloatArray]
) -> list[T]:
    """The first `most` of the paths whose places (K, n) are more than `enough` rad apart from all
    before.
    """
    chosen: list[tuple[T, FloatArray]] = []
    for path in paths:
        if len(chosen) == most:
            break
        mine = places(path)
        if all(apart(mine, other) > enough for _, other in chosen):
            chosen.append((path, mine))
    return [path for path, _ in chosen]


def different_paths(paths: list[FloatArray], weights: FloatArray) -> list[FloatArray]:
    """The cheapest few of paths (M_k, n) by W, weights (n,), that differ in their middle
    waypoint.
    """
    cheapest = sorted(paths, key=lambda path: path_cost(weights, path))
    return first_different(cheapest, PATHS, MIDDLE, lambda path: path[len(path) // 2])


def evenly(path: FloatArray) -> FloatArray:
    """Configurations (16, n) at even distances along a path (M, n)."""
    return evenly_spaced(path, _EVENLY)


def at_nine_shares(path: FloatArray) -> FloatArray:
    """Configurations (9, n) between a tenth and nine tenths of the length of a path (M, n)."""
    return at_shares(path, _NINE)
