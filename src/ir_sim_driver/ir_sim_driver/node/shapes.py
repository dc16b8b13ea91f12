"""The robot's capsules as bodies to draw: a cylinder and two balls each, in the world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ir_description import Capsule
from ir_msgs_py.arrays import FloatArray

_SHORTEST = 1e-6  # m; a cylinder of no length is no marker


class Shape(NamedTuple):
    """A capsule in the world: ends (2, 3) [m], radius and length [m], centre (3,), quaternion xyzw
    (4,) of its axis z.
    """

    ends: FloatArray
    radius: float
    length: float
    centre: FloatArray
    quaternion: FloatArray


def shapes_of(capsules: Sequence[Capsule], link_poses: FloatArray) -> list[Shape]:
    """Shapes of capsules on links that stand at link_poses (n+1, 4, 4)."""
    shapes = []
    for capsule in capsules:
        T = link_poses[capsule.link]
        ends = np.array([T[:3, :3] @ p + T[:3, 3] for p in (capsule.p0, capsule.p1)])
        axis = ends[1] - ends[0]
        length = float(np.linalg.norm(axis))
        shapes.append(
            Shape(
                ends,
                float(capsule.radius),
                max(length, _SHORTEST),
                ends.mean(axis=0),
                turn_z_to(axis, length),
            )
        )
    return shapes


def turn_z_to(direction: FloatArray, length: float) -> FloatArray:
    """Quaternion xyzw (4,) of the shortest turn of +z into a direction (3,) of that length."""
    if length < _SHORTEST:
        return np.array((0.0, 0.0, 0.0, 1.0))
    x, y, z = (direction / length).tolist()
    if z < -1.0 + 1e-9:
        return np.array((1.0, 0.0, 0.0, 0.0))
    quaternion = np.array((-y, x, 0.0, 1.0 + z))
    unit: FloatArray = quaternion / np.linalg.norm(quaternion)
    return unit
