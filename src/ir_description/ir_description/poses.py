"""Orientations as people write them: KUKA's A, B, C and quaternions, to matrices and back.

A, B, C [deg] turn about Z, then the new Y, then the new X: R = Rz(A) Ry(B) Rx(C).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import portable
from ir_values.arrays import FloatArray, frozen
from ir_values.errors import InvalidValueError
from ir_values.rotations import rotations_from_unit_quaternions

QUATERNION_TOLERANCE = 1e-3
"""A quaternion this far from unit length is normalised, beyond it is refused."""
MATRIX_TOLERANCE = 1e-6
"""A matrix this far from orthonormal is made so, beyond it is refused."""
_POLAR_STEPS = 3


def pose_of(position: ArrayLike, rotation: ArrayLike | None = None) -> FloatArray:
    """Return the read-only pose (4, 4) of a position (3,) [m] and a rotation (3, 3)."""
    pose = np.eye(4)
    pose[:3, 3] = position
    if rotation is not None:
        pose[:3, :3] = rotation
    return frozen(pose, (4, 4), "pose")


def inverse(pose: FloatArray) -> FloatArray:
    """Return the inverse (4, 4) of a pose."""
    R = pose[:3, :3].T
    return pose_of(-portable.matmul(R, pose[:3, 3]), R)


def composed(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return first @ second (4, 4) as a read-only pose (4, 4) whose last row is exact."""
    pose = portable.matmul(first, second)
    pose[3] = (0.0, 0.0, 0.0, 1.0)
    return frozen(pose, (4, 4), "pose")


def _cos_sin(angle_deg: float) -> tuple[float, float]:
    """Cosine and sine, exact at multiples of 90 degrees."""
    turn = math.fmod(angle_deg, 360.0)
    quarter = turn / 90.0
    if quarter == round(quarter):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    radians = math.radians(turn)
    return float(portable.cos(radians)), float(portable.sin(radians))


def rotation_from_abc(abc_deg: ArrayLike) -> FloatArray:
    """Return the rotation (3, 3) of KUKA's A, B, C [deg]."""
    a, b, c = frozen(abc_deg, (3,), "abc_deg")
    ca, sa = _cos_sin(a)
    cb, sb = _cos_sin(b)
    cc, sc = _cos_sin(c)
    return np.array(
        [
            [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
            [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
            [-sb, cb * sc, cb * cc],
        ]
    )


def abc_from_rotation(rotation: FloatArray) -> FloatArray:
    """Return A, B, C [deg] of a rotation (3, 3), B in [-90, 90]; where A and C share an axis, C is
    0.
    """
    R = np.asarray(rotation, dtype=np.float64)
    b = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    if math.hypot(R[0, 0], R[1, 0]) > 1e-9:
        a = math.atan2(R[1, 0], R[0, 0])
        c = math.atan2(R[2, 1], R[2, 2])
    else:
        a = math.atan2(-R[0, 1], R[1, 1])
        c = 0.0
    return np.degrees([a, b, c])


def rotation_from_quaternion(xyzw: ArrayLike) -> FloatArray:
    """Return the rotation (3, 3) of a quaternion x, y, z, w; small errors of length are normalised.
    Raises InvalidValueError for larger ones.
    """
    q = frozen(xyzw, (4,), "quaternion")
    length = portable.norm(q)
    if abs(length - 1.0) > QUATERNION_TOLERANCE:
        raise InvalidValueError(
            f"quaternion has length {length:g}, must be 1 within {QUATERNION_TOLERANCE:g} (order "
            "x, y, z, w)"
        )
    return rotations_from_unit_quaternions(q / length)


def rotation_from_matrix(rows: ArrayLike) -> FloatArray:
    """Return rows (3, 3) as a rotation; errors of a few written digits are removed. Raises
    InvalidValueError for what is no rotation.
    """
    R = frozen(rows, (3, 3), "rotation")
    error = float(np.abs(R @ R.T - np.eye(3)).max())
    if error > MATRIX_TOLERANCE or np.linalg.det(R) < 0.0:
        raise InvalidValueError("rotation is not a right-handed orthonormal matrix")
    if error <= 1e-12:
        return R
    for _ in range(_POLAR_STEPS):  # towards the nearest rotation (Higham 1986), quadratically
        R = 0.5 * (R + portable.inv(R).T)
    return R


def transformed(pose: FloatArray, points: FloatArray) -> FloatArray:
    """Return the points (N, 3) or (3,) moved by a pose (4, 4)."""
    moved: FloatArray = portable.matmul(points, pose[:3, :3].T) + pose[:3, 3]
    return moved
