"""Shapes of a cell in Coal, an independent library for distances, and the distances of its pairs;
tests use them too.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import coal
import numpy as np

from ir_values.arrays import FloatArray


def along_z(p0: FloatArray, p1: FloatArray) -> FloatArray:
    """Pose of a frame in the middle of a segment, z along it."""
    pose = np.eye(4)
    d = p1 - p0
    z = d / np.linalg.norm(d)
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = (p0 + p1) / 2.0
    return pose


def solid(body: Any) -> coal.CollisionGeometry:
    """A body of a cell, in its own frame."""
    if body.kind == "box":
        return coal.Box(*body.size)
    if body.kind == "cylinder":
        return coal.Cylinder(body.size[0], body.size[1])
    if body.kind == "sphere":
        return coal.Sphere(body.size[0])
    if body.kind == "capsule":
        return coal.Capsule(body.size[0], body.size[1])
    if body.kind == "plane":
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    points = coal.StdVec_Vec3s()
    for vertex in body.vertices:
        points.append(vertex)
    return coal.Convex.convexHull(points, False, "")


def transform(pose: FloatArray) -> coal.Transform3s:
    """A pose (4, 4) as Coal has it."""
    return coal.Transform3s(np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3]))


class CoalScene:
    """Distances of capsules on links from each other and from bodies, pair by pair."""

    def __init__(self, capsules: Iterable[Any], bodies: Iterable[Any], **request: float) -> None:
        self.bodies = {body.name: (solid(body), transform(body.pose)) for body in bodies}
        self.capsules = {}
        for c in capsules:
            length = float(np.linalg.norm(c.p1 - c.p0))
            local = along_z(c.p0, c.p1) if length > 0.0 else np.eye(4)
            local[:3, 3] = (c.p0 + c.p1) / 2.0
            self.capsules[c.name] = (c.link, coal.Capsule(c.radius, length), local)
        self.request = coal.DistanceRequest()
        self.request.enable_signed_distance = True
        for name, value in request.items():
            setattr(self.request, name, value)

    def distance(self, kind: str, body_a: str, body_b: str, poses: Sequence[FloatArray]) -> float:
        """Signed distance [m] of a capsule from another one ("SELF") or from a body; poses (4, 4)
        of the links in the world.
        """
        link, shape, local = self.capsules[body_a]
        here = transform(poses[link] @ local)
        if kind == "SELF":
            link, other, local = self.capsules[body_b]
            there = transform(poses[link] @ local)
        else:
            other, there = self.bodies[body_b]
        result = coal.DistanceResult()
        return float(coal.distance(shape, here, other, there, self.request, result))
