"""Solutions of inverse kinematics, whichever solver found them: turns within the limits, and the
last digits by Newton's steps.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import data, portable
from ir_kernels.chain import Chain
from ir_kernels.errors import KernelError
from ir_kernels.reference.inverse_kinematics import LIMIT_TOLERANCE
from ir_values.arrays import FloatArray, IntArray


class IkSet(NamedTuple):
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
    """Both limits (6,) [rad], checked and read-only. Raises KernelError."""
    low, high = (
        data.read_only(data.array(np.ascontiguousarray(values), name, (6,)).copy())
        for name, values in (("position_min", position_min), ("position_max", position_max))
    )
    if (low > high).any():
        j = int(np.argmax(low > high))
        raise KernelError(
            f"position_min[{j}] is {low[j]} rad, above position_max[{j}], {high[j]} rad"
        )
    return low, high


# Newton's steps that bring solutions to the last digits.

_STEPS = 3  # doubling the digits each: 1e-5 rad of a near-tangent to rounding
_EXACT = 1e-13  # m and rad: what rounding leaves
_DAMPING = 1e-10  # of the squared singular values: a singular configuration stays where it is
_MOST = 0.2  # rad in one step


def polished(chain: Chain, targets: FloatArray, found: Sequence[Found]) -> list[Found]:
    """What was found for targets (N, 4, 4), each that isn't exact after Newton's steps where these
    brought it nearer.
    """
    if not found:
        return []
    rows = np.array([row for row, _, _ in found])
    q = np.array([each for _, _, each in found])
    off = np.linalg.norm(pose_error(chain, targets[rows], q), axis=1) > _EXACT
    q[off], _ = newton(chain, targets[rows[off]], q[off], _STEPS)
    return [(row, branch, own) for (row, branch, _), own in zip(found, q, strict=True)]


def newton(
    chain: Chain, poses: FloatArray, q: FloatArray, steps: int
) -> tuple[FloatArray, FloatArray]:
    """q (M, 6) after damped steps towards poses (M, 4, 4), the best of each, and its error (M,) [m,
    rad].
    """
    best = q.copy()
    least = np.full(len(q), np.inf)
    if not len(q):
        return best, least
    for step in range(steps + 1):
        error = pose_error(chain, poses, q)
        size = np.linalg.norm(error, axis=1)
        nearer = size < least
        best[nearer] = q[nearer]
        least[nearer] = size[nearer]
        if step < steps:
            J = chain.jacobian(q)
            JT = np.swapaxes(J, 1, 2)
            change = (
                portable.matmul(
                    JT,
                    portable.solve(
                        portable.matmul(J, JT) + _DAMPING * np.eye(6), error[:, :, None]
                    ),
                )
            )[:, :, 0]
            q = q + np.clip(change, -_MOST, _MOST)
    return best, least


def pose_error(chain: Chain, poses: FloatArray, q: FloatArray) -> FloatArray:
    """(M, 6): metres and radians from the tcp at q (M, 6) to poses (M, 4, 4)."""
    now = chain.tcp_poses(q)
    R = portable.matmul(poses[:, :3, :3], np.swapaxes(now[:, :3, :3], 1, 2))
    twist = 0.5 * np.stack(
        [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1
    )
    sine = np.linalg.norm(twist, axis=1)
    angle = portable.arctan2(sine, 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0))
    factor = np.where(sine > 1e-8, angle / np.where(sine > 1e-8, sine, 1.0), 1.0)
    return np.concatenate([poses[:, :3, 3] - now[:, :3, 3], factor[:, None] * twist], axis=1)
