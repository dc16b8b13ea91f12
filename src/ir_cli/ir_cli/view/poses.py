"""Poses between the cell, viser and what a person may mean: rounded to millimetres and tenths of a
degree.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ir_description.poses import abc_from_rotation, pose_of, rotation_from_abc
from ir_msgs_py.arrays import FloatArray

MILLIMETRE = 3  # digits of m
TENTH = 1  # digits of deg
_SAME_PLACE = 2e-6  # m: a browser's numbers have 24 bits
_SAME_TURN = 1e-5  # rad


def quaternion(rotation: FloatArray) -> FloatArray:
    """w, x, y, z of a rotation (3, 3)."""
    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def placed(handle: Any, pose: FloatArray) -> None:
    """Puts what is drawn at a pose (4, 4) in its parent."""
    handle.wxyz = quaternion(pose[:3, :3])
    handle.position = np.array(pose[:3, 3])


def pose_of_handle(handle: Any) -> FloatArray:
    """The pose (4, 4) of what was dragged. Raises ValueError for numbers that are none."""
    w, x, y, z = (float(value) for value in handle.wxyz)
    xyz = np.array([float(value) for value in handle.position])
    if not np.isfinite([w, x, y, z, *xyz]).all():
        raise ValueError("a pose must be finite")
    return pose_of(xyz, Rotation.from_quat([x, y, z, w]).as_matrix())


def meant(dragged: FloatArray, before: FloatArray) -> FloatArray:
    """A dragged pose (4, 4) on the grid of what is written; what did not move stays as it was
    before.
    """
    moved = np.abs(dragged[:3, 3] - before[:3, 3]) > _SAME_PLACE
    xyz = np.where(moved, np.round(dragged[:3, 3], MILLIMETRE), before[:3, 3])
    turned = Rotation.from_matrix(dragged[:3, :3] @ before[:3, :3].T).magnitude() > _SAME_TURN
    if not turned:
        return pose_of(xyz, before[:3, :3])
    return pose_of(xyz, rotation_from_abc(np.round(abc_from_rotation(dragged[:3, :3]), TENTH)))
