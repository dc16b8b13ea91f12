"""A body of the cell: a convex primitive or the convex hull of points, rigid, with a pose."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from ir_description.arrays import frozen, frozen_pose
from ir_description.poses import composed, pose_of
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

BodyKind = Literal["box", "cylinder", "sphere", "capsule", "plane", "mesh"]
KINDS: tuple[BodyKind, ...] = get_args(BodyKind)
SIZE_MAX = 1000.0
"""Largest length [m] of a body."""
_LENGTHS = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "plane": 0, "mesh": 0}
_NO_VERTICES = frozen(np.zeros((0, 3)), (0, 3), "vertices")


@dataclass(frozen=True, eq=False)
class Body:
    """pose (4, 4) in the frame of its owner (a machine or part); in the world for what Cell.bodies
    returns.

    size (3,) [m]: box the full edges; cylinder (radius, length, 0) about z; sphere (radius, 0, 0);
    capsule (radius, length between the sphere centres, 0) about z; plane and mesh zeros. A plane is
    solid below its z axis. vertices (V, 3) [m] in the body's frame for a mesh, whose convex hull is
    the body; (0, 3) otherwise.
    """

    name: str
    kind: BodyKind
    pose: FloatArray
    size: FloatArray
    vertices: FloatArray = field(default_factory=lambda: _NO_VERTICES)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InvalidValueError(
                f"kind of {self.name} is {self.kind!r}, must be one of {', '.join(KINDS)}"
            )
        object.__setattr__(self, "pose", frozen_pose(self.pose, f"pose of {self.name}"))
        object.__setattr__(self, "size", frozen(self.size, (3,), f"size of {self.name}"))
        object.__setattr__(
            self, "vertices", frozen(self.vertices, (None, 3), f"vertices of {self.name}")
        )
        used = _LENGTHS[self.kind]
        positive = 1 if self.kind == "capsule" else used  # a capsule of length 0 is a sphere
        if (
            (self.size[:positive] <= 0.0).any()
            or (self.size < 0.0).any()
            or (self.size > SIZE_MAX).any()
            or self.size[used:].any()
        ):
            raise InvalidValueError(
                f"size of {self.name} is {self.size.tolist()} m, a {self.kind} must have its "
                f"first {used} in (0, {SIZE_MAX:g}] m and the others 0"
            )
        if (self.kind == "mesh") != (len(self.vertices) >= 4):
            raise InvalidValueError(
                f"{self.name} has {len(self.vertices)} vertices, a mesh must have at least 4 and "
                "others none"
            )

    def placed(self, pose: FloatArray) -> Body:
        """Return the body re-expressed by the pose (4, 4) of its owner's frame."""
        return replace(self, pose=composed(pose, self.pose))

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and highest corner (3,) [m] in the owner's frame; infinite for a
        plane.
        """
        R = self.pose[:3, :3]
        centre = self.pose[:3, 3]
        if self.kind == "plane":
            return np.full(3, -np.inf), np.full(3, np.inf)
        if self.kind == "mesh":
            points = self.vertices @ R.T + centre
            return points.min(axis=0), points.max(axis=0)
        if self.kind == "box":
            reach = np.abs(R) @ (self.size / 2.0)
        elif self.kind == "sphere":
            reach = np.full(3, self.size[0])
        else:
            axis = np.abs(R[:, 2])
            side = (
                np.sqrt(np.maximum(0.0, 1.0 - axis**2)) if self.kind == "cylinder" else np.ones(3)
            )
            reach = axis * self.size[1] / 2.0 + side * self.size[0]
        return centre - reach, centre + reach


def floor_body() -> Body:
    """Return the floor: the plane z = 0 of the world."""
    return Body("floor", "plane", pose_of((0.0, 0.0, 0.0)), np.zeros(3))
