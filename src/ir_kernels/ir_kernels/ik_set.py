"""What inverse kinematics gives, whichever solver found it, and the turns within the limits."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import data
from ir_kernels.errors import InputError
from ir_kernels.reference.inverse_kinematics import LIMIT_TOLERANCE
from ir_values.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class IkSet:
    """Solutions sorted by pose, branch, q: q (M, 6) rad, pose_index (M,) which pose each belongs
    to, branch (M,): its number, see the solver.
    """

    q: FloatArray
    pose_index: IntArray
    branch: IntArray

    def of_pose(self, index: int) -> FloatArray:
        """(m, 6): the solutions of one pose."""
        begin, end = np.searchsorted(self.pose_index, [index, index + 1])
        solutions: FloatArray = self.q[begin:end]
        return solutions


class InverseKinematics(Protocol):
    """All configurations within the limits that bring a chain's tcp to a pose."""

    def solve(self, poses: ArrayLike) -> IkSet:
        """All solutions for poses (N, 4, 4) of the tcp in the world."""
        ...


Found = tuple[int, int, FloatArray]
"""Which pose, which branch, and q (6,) in any turn."""


def with_turns(found: Iterable[Found], low: FloatArray, high: FloatArray) -> IkSet:
    """Every turn of what was found that lies within the limits (6,), sorted and read-only."""
    solutions = list(found)
    q = np.array([q for _, _, q in solutions]).reshape(-1, 6)
    rows = np.array([(pose, branch) for pose, branch, _ in solutions], np.int64).reshape(-1, 2)
    for axis in range(6):
        node, values = turns_of_all(q[:, axis], float(low[axis]), float(high[axis]))
        q = q[node]
        rows = rows[node]
        q[:, axis] = values
    order = np.lexsort((*q.T[::-1], rows[:, 1], rows[:, 0]))
    arrays = q[order], rows[order, 0], rows[order, 1]
    for array in arrays:
        array.setflags(write=False)
    return IkSet(*arrays)


def turns_of_all(angles: FloatArray, low: float, high: float) -> tuple[IntArray, FloatArray]:
    """All values angle + 2 pi k within [low, high]: which angle (M,) each is of, in order, and its
    value (M,); within LIMIT_TOLERANCE of a limit counts as on it.
    """
    first = np.ceil((low - LIMIT_TOLERANCE - angles) / (2.0 * np.pi)).astype(np.int64)
    last = np.floor((high + LIMIT_TOLERANCE - angles) / (2.0 * np.pi)).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    which = np.repeat(np.arange(len(angles)), count)
    turn = np.arange(len(which)) + np.repeat(first - np.cumsum(count) + count, count)
    return which, np.clip(angles[which] + 2.0 * np.pi * turn, low, high)


def limits(position_min: ArrayLike, position_max: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Both limits (6,) [rad], checked and read-only. Raises InputError."""
    low, high = (
        data.read_only(data.array(np.ascontiguousarray(values), name, (6,)).copy())
        for name, values in (("position_min", position_min), ("position_max", position_max))
    )
    if (low > high).any():
        j = int(np.argmax(low > high))
        raise InputError(
            f"position_min[{j}] is {low[j]} rad, above position_max[{j}], {high[j]} rad"
        )
    return low, high
