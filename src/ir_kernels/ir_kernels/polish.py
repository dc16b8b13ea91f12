"""Newton's steps that bring solutions to the last digits."""

from collections.abc import Sequence

import numpy as np

from ir_kernels import portable
from ir_kernels.chain import Chain
from ir_kernels.ik_set import Found
from ir_values.arrays import FloatArray

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
