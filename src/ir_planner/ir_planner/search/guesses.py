"""Guesses: paths of many homotopy classes that need not be free, the same for every seed.

Descents start from them (optimize/portfolio.py). Clearance is a part of their cost, and penetration
counts with its depth, so a guess is pushed out of what it collides with, into the local minimum of
its class. The arm is folded, lifted or turned to a side between start and goal, or goes over the
cell's park posture. Which guesses, and in which order, was measured on variants of cells: each adds
most to those before it.
"""

from collections.abc import Iterator

import numpy as np

from ir_values.arrays import FloatArray

# rad by which the first five joints bulge, once in the middle, or at a quarter and at three
# quarters
_MIDDLE = (
    (0.0, -0.6, 0.0, 0.0, 0.0),
    (-0.6, -0.6, -0.6, 0.0, 0.0),
    (0.6, -0.6, -0.6, 0.0, 0.0),
    (0.0, -0.6, 0.0, 0.0, -0.6),
    (0.0, -0.6, 0.0, 0.0, 0.6),
    (0.0, -1.0, 1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0, 0.0, 1.0),
)
_QUARTERS = (
    (0.0, 0.0, 0.0, 0.0, -1.0),
    (0.0, -1.0, 1.0, 0.0, 1.0),
    (0.0, -1.0, 0.0, 0.0, 1.0),
    (0.0, 1.0, 1.0, 0.0, -1.0),
    (0.0, -1.0, -1.0, 0.0, 1.0),
    (-0.6, 0.0, 0.0, 0.0, -0.6),
    (0.6, 0.0, 0.0, 0.0, -0.6),
    (0.0, 0.0, 0.0, 0.0, 1.0),
    (0.0, -1.0, 1.0, 0.0, -1.0),
    (0.0, 0.0, 1.0, 0.0, 0.0),
    (0.0, -1.0, 0.0, 0.0, -1.0),
)
_RETRACTED = 0.75  # of the joint steps to the park posture


def guesses(
    start: FloatArray, goal: FloatArray, park: FloatArray, low: FloatArray, high: FloatArray
) -> list[FloatArray]:
    """Paths (M, n) from start to goal (n,) within the limits low, high (n,); park (n,): the arm
    well back.
    """
    paths = [*_over_park(start, goal, park), *_bulges(start, goal), np.stack([start, goal])]
    ends = np.cumsum([len(path) for path in paths])
    within = np.clip(np.concatenate(paths), low, high)
    return [within[end - len(path) : end] for path, end in zip(paths, ends, strict=True)]


def _over_park(start: FloatArray, goal: FloatArray, park: FloatArray) -> Iterator[FloatArray]:
    """Retracted towards park at both ends; joints 2 and 3 as in park in the middle; over park,
    turned to where goal or start look.
    """
    back = [q + _RETRACTED * (park - q) for q in (start, goal)]
    back[0][0] = start[0]
    back[1][0] = goal[0]
    yield np.stack([start, *back, goal])
    middle = 0.5 * (start + goal)
    middle[1:3] = park[1:3]
    yield np.stack([start, middle, goal])
    for looking in (goal, start):
        over = park.copy()
        over[0] = looking[0]
        yield np.stack([start, over, goal])


def _bulges(start: FloatArray, goal: FloatArray) -> Iterator[FloatArray]:
    """The straight segment with a bulge; the first of either kind in turns."""
    step = goal - start
    for k in range(max(len(_MIDDLE), len(_QUARTERS))):
        if k < len(_MIDDLE):
            yield np.stack([start, start + 0.5 * step + _joints(_MIDDLE[k], step), goal])
        if k < len(_QUARTERS):
            bulge = _joints(_QUARTERS[k], step)
            yield np.stack([start, start + 0.25 * step + bulge, start + 0.75 * step + bulge, goal])


def _joints(bulge: tuple[float, ...], like: FloatArray) -> FloatArray:
    """As long as a configuration: joints beyond the fifth stay."""
    joints = np.zeros_like(like)
    count = min(len(bulge), len(joints))
    joints[:count] = bulge[:count]
    return joints
