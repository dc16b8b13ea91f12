"""What inverse kinematics gives, whichever solver found it, and the turns within the limits."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import data
from ir_kernels.errors import InputError
from ir_kernels.reference.inverse_kinematics import turns
from ir_msgs_py.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class IkSet:
    """Solutions sorted by pose, branch, q: q (M, 6) rad, pose_index (M,) which pose each belongs to, branch
    (M,): its number, see the solver.
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
    rows = sorted(
        (pose, branch, values)
        for pose, branch, q in found
        for values in product(
            *(turns(float(v), float(a), float(b)) for v, a, b in zip(q, low, high, strict=True))
        )
    )
    q = np.array([row[2] for row in rows]).reshape(-1, 6)
    arrays = q, np.array([row[0] for row in rows], np.int64), np.array([row[1] for row in rows], np.int64)
    for array in arrays:
        array.setflags(write=False)
    return IkSet(*arrays)


def limits(position_min: ArrayLike, position_max: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Both limits (6,) [rad], checked and read-only. Raises InputError."""
    low, high = (
        data.read_only(data.array(np.ascontiguousarray(values), name, (6,)).copy())
        for name, values in (("position_min", position_min), ("position_max", position_max))
    )
    if (low > high).any():
        j = int(np.argmax(low > high))
        raise InputError(f"position_min[{j}] is {low[j]} rad, above position_max[{j}], {high[j]} rad")
    return low, high
