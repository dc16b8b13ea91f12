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
    xx = R[..., 0, 0]
    yy = R[..., 1, 1]
    zz = R[..., 2, 2]
    trace = xx + yy + zz
    xy = R[..., 1, 0] + R[..., 0, 1]
    xz = R[..., 0, 2] + R[..., 2, 0]
    yz = R[..., 2, 1] + R[..., 1, 2]
    xw = R[..., 2, 1] - R[..., 1, 2]
    yw = R[..., 0, 2] - R[..., 2, 0]
    zw = R[..., 1, 0] - R[..., 0, 1]

    # four multiples of the quaternion, each of which is short where its own entry is small
    from_x = np.stack((1.0 - trace + 2.0 * xx, xy, xz, xw), axis=-1)
    from_y = np.stack((xy, 1.0 - trace + 2.0 * yy, yz, yw), axis=-1)
    from_z = np.stack((xz, yz, 1.0 - trace + 2.0 * zz, zw), axis=-1)
    from_w = np.stack((xw, yw, zw, 1.0 + trace), axis=-1)
    candidates = np.stack([from_x, from_y, from_z, from_w], axis=-2)
    largest = np.argmax(np.stack([xx, yy, zz, trace], axis=-1), axis=-1)
    q = np.take_along_axis(candidates, largest[..., None, None], axis=-2)[..., 0, :]
    x = q[..., 0]
    y = q[..., 1]
    z = q[..., 2]
    w = q[..., 3]
    length = np.sqrt(x * x + y * y + z * z + w * w)
    q = q / length[..., None]
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
    x = quaternions[..., 0]
    y = quaternions[..., 1]
    z = quaternions[..., 2]
    w = quaternions[..., 3]
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
