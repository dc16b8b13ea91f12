"""Quaternions of rotation matrices, and back: with the four operations and roots alone, so that
they are the same bytes on every processor and with every version of SciPy.
"""

from __future__ import annotations

import numpy as np

from ir_values.arrays import FloatArray


def quaternions_from_rotations(rotations: FloatArray) -> FloatArray:
    """Unit quaternions (..., 4) x, y, z, w with w >= 0 of rotations (..., 3, 3).

    From the largest of the three diagonal entries and their sum, which keeps all digits (Markley,
    "Unit Quaternion from Rotation Matrix", 2008). At a half turn, w = 0, the first other entry
    that is not 0 is positive.
    """
    R = np.asarray(rotations, dtype=np.float64)
    xx, yy, zz = (R[..., k, k] for k in range(3))
    trace = xx + yy + zz
    xy = R[..., 1, 0] + R[..., 0, 1]
    xz = R[..., 0, 2] + R[..., 2, 0]
    yz = R[..., 2, 1] + R[..., 1, 2]
    xw = R[..., 2, 1] - R[..., 1, 2]
    yw = R[..., 0, 2] - R[..., 2, 0]
    zw = R[..., 1, 0] - R[..., 0, 1]
    by_largest = (
        (1.0 - trace + 2.0 * xx, xy, xz, xw),
        (xy, 1.0 - trace + 2.0 * yy, yz, yw),
        (xz, yz, 1.0 - trace + 2.0 * zz, zw),
        (xw, yw, zw, 1.0 + trace),
    )
    candidates = np.stack([np.stack(each, axis=-1) for each in by_largest], axis=-2)
    largest = np.argmax(np.stack([xx, yy, zz, trace], axis=-1), axis=-1)
    q = np.take_along_axis(candidates, largest[..., None, None], axis=-2)[..., 0, :]
    x, y, z, w = (q[..., k] for k in range(4))
    q = q / np.sqrt(x * x + y * y + z * z + w * w)[..., None]
    return np.where(_is_reversed(q)[..., None], -q, q)


def _is_reversed(q: FloatArray) -> FloatArray:
    """Whether the first of w, x, y, z (...,) that is not 0 is negative."""
    x, y, z, w = (q[..., k] for k in range(4))
    of_half_turn = np.where(x != 0.0, x, np.where(y != 0.0, y, z))
    return np.asarray(np.where(w != 0.0, w, of_half_turn) < 0.0)


def rotations_from_quaternions(quaternions: FloatArray) -> FloatArray:
    """Rotations (..., 3, 3) of quaternions (..., 4) x, y, z, w that are not 0, of any length."""
    q = np.asarray(quaternions, dtype=np.float64)
    x, y, z, w = (q[..., k] for k in range(4))
    length = np.sqrt(x * x + y * y + z * z + w * w)
    return rotations_from_unit_quaternions(q / length[..., None])


def rotations_from_unit_quaternions(quaternions: FloatArray) -> FloatArray:
    """Rotations (..., 3, 3) of quaternions (..., 4) x, y, z, w of length 1."""
    x, y, z, w = (quaternions[..., k] for k in range(4))
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
