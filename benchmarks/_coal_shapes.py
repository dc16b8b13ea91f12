"""Shapes of a cell in Coal, an independent library for distances; the tests of the kernels use them
too.
"""

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
