"""Principal axes of an inertia, the same bits on every machine."""

import numpy as np

from ir_description.poses import abc_from_rotation
from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray

_SWEEPS = 30
_NONE = 1e-9  # of the trace: what is below is no product of inertia


def principal_axes(inertia: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Moments (3,) about the axes, and the axes (3, 3) as columns of a rotation, of a symmetric
    inertia (3, 3), by Jacobi's rotations.
    """
    a = np.array(inertia, dtype=float)
    axes = np.eye(3)
    small = _NONE * abs(float(np.trace(a)))
    for _ in range(_SWEEPS):
        k = int(np.argmax([abs(a[0, 1]), abs(a[0, 2]), abs(a[1, 2])]))
        i, j = ((0, 1), (0, 2), (1, 2))[k]
        if abs(a[i, j]) <= small:
            break
        theta = (a[j, j] - a[i, i]) / (2.0 * a[i, j])
        t = float(np.copysign(1.0, theta) / (abs(theta) + np.sqrt(theta * theta + 1.0)))
        c = 1.0 / np.sqrt(t * t + 1.0)
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = c
        turn[i, j] = c * t
        turn[j, i] = -c * t
        a = portable.matmul(turn.T, a, turn)
        axes = portable.matmul(axes, turn)
    return np.diag(a).copy(), axes


def abc_of_axes(axes: FloatArray) -> FloatArray:
    """A, B, C [deg] of axes (3, 3)."""
    return np.asarray(abc_from_rotation(axes))
