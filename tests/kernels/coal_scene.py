"""The same robot and scene in Coal, an independent library for distances."""

import coal
import numpy as np
from geometry_cases import CAPSULES, Body, FloatArray


def transform(pose: FloatArray) -> coal.Transform3s:
    return coal.Transform3s(np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3]))


def solid(body: Body) -> coal.CollisionGeometry:
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


class CoalScene:
    """Distances of the capsules of the KR 210 by Coal, pair by pair."""

    def __init__(self, bodies: tuple[Body, ...]) -> None:
        self.bodies = {body.name: (solid(body), transform(body.pose)) for body in bodies}
        self.capsules = {}
        for c in CAPSULES:
            shape = coal.Capsule(c.radius, float(np.linalg.norm(c.p1 - c.p0)))
            self.capsules[c.name] = (c.link, shape, along_z(c.p0, c.p1))
        self.request = coal.DistanceRequest()
        self.request.enable_signed_distance = True
        self.request.gjk_tolerance = 1e-9

    def distance(self, kind: str, body_a: str, body_b: str, link_poses: FloatArray) -> float:
        link, shape, local = self.capsules[body_a]
        here = transform(link_poses[link] @ local)
        if kind == "SELF":
            link, other, local = self.capsules[body_b]
            there = transform(link_poses[link] @ local)
        else:
            other, there = self.bodies[body_b]
        result = coal.DistanceResult()
        return float(coal.distance(shape, here, other, there, self.request, result))
