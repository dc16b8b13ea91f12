"""Candidates of simple detours: over the named postures, with the arm retracted first, or over one
via.

They are generated in one go and certified in one batch; which of them are free is another question.
"""

import numpy as np

from ir_msgs_py.arrays import FloatArray

_SHARES = (0.25, 0.5, 0.75, 1.0)  # of the joint step to a posture by which the arm is retracted
_SPREADS = (0.15, 0.35, 0.7)  # rad: how far vias are scattered around the straight movement


def over_postures(
    start: FloatArray, goal: FloatArray, postures: list[FloatArray]
) -> list[FloatArray]:
    """Paths (3, n) over each posture, and over each turned to where start, goal or the middle
    look.
    """
    paths = []
    for posture in postures:
        paths.append(np.stack([start, posture, goal]))
        for first in (start[0], goal[0], 0.5 * (start[0] + goal[0])):
            turned = posture.copy()
            turned[0] = first
            paths.append(np.stack([start, turned, goal]))
    return paths


def over_retracted_arm(
    start: FloatArray, goal: FloatArray, postures: list[FloatArray]
) -> list[FloatArray]:
    """Paths (4, n) and (3, n): retract the arm towards a posture, turn, and reach out again.

    Once with all joints but the first, once with the arm (joints 2 and 3) alone.
    """
    n = len(start)
    arm = np.zeros(n, dtype=bool)
    arm[1:3] = True
    rest = np.ones(n, dtype=bool)
    rest[0] = False
    paths = []
    for posture in postures:
        for joints in (rest, arm):
            for share in _SHARES:
                back = [q + share * np.where(joints, posture - q, 0.0) for q in (start, goal)]
                paths.append(np.stack([start, *back, goal]))
                middle = 0.5 * (back[0] + back[1])
                paths.append(np.stack([start, middle, goal]))
    return paths


def scattered(
    start: FloatArray,
    goal: FloatArray,
    low: FloatArray,
    high: FloatArray,
    count: int,
    rng: np.random.Generator,
) -> list[FloatArray]:
    """`count` paths (3, n) over vias scattered around the straight movement, within the limits."""
    along = rng.uniform(0.2, 0.8, (count, 1))
    spread = rng.choice(_SPREADS, (count, 1))
    vias = start + along * (goal - start) + spread * rng.standard_normal((count, len(start)))
    vias = np.clip(vias, low, high)
    return [np.stack([start, via, goal]) for via in vias]
