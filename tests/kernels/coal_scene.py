"""The same robot and scene in Coal, an independent library for distances."""

import coal
import numpy as np
from _coal_shapes import along_z, solid
from geometry_cases import CAPSULES, Body, FloatArray


def transform(pose: FloatArray) -> coal.Transform3s:
    return coal.Transform3s(np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3]))


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
