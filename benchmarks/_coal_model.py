"""The same cell in Coal through Pinocchio: a judge of distances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import pinocchio
from _coal_shapes import along_z, solid

from ir_kernels import CollisionModel
from ir_values.arrays import FloatArray


def _se3(pose: FloatArray) -> Any:
    return pinocchio.SE3(np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3]))


class Coal:
    """All pairs of a collision model, computed by pinocchio.computeDistances."""

    def __init__(
        self, model: CollisionModel, capsules: Sequence[Any], bodies: Sequence[Any]
    ) -> None:
        self.model = pinocchio.Model()
        parent = 0
        chain = model.chain
        for i, (origin, axis) in enumerate(zip(chain.joint_origin, chain.joint_axis, strict=True)):
            base = chain.base_pose if i == 0 else np.eye(4)
            joint = pinocchio.JointModelRevoluteUnaligned(np.array(axis))
            parent = self.model.addJoint(parent, joint, _se3(base @ origin), f"joint_{i}")
        self.geometry = pinocchio.GeometryModel()
        index = {}
        for c in capsules:
            shape = coal.Capsule(c.radius, float(np.linalg.norm(c.p1 - c.p0)))
            local = along_z(c.p0, c.p1) if c.link else chain.base_pose @ along_z(c.p0, c.p1)
            item = pinocchio.GeometryObject(f"capsule {c.name}", c.link, 0, _se3(local), shape)
            index[c.name] = self.geometry.addGeometryObject(item)
        for body in bodies:
            item = pinocchio.GeometryObject(
                f"body {body.name}", 0, 0, _se3(np.asarray(body.pose)), solid(body)
            )
            index[f"body {body.name}"] = self.geometry.addGeometryObject(item)
        for pair in model.pairs:
            other = pair.body_b if pair.kind == "SELF" else f"body {pair.body_b}"
            self.geometry.addCollisionPair(
                pinocchio.CollisionPair(index[pair.body_a], index[other])
            )
        self.data = self.model.createData()
        self.geometry_data = self.geometry.createData()

    def compute(self, q: FloatArray) -> None:
        """All distances at one configuration."""
        pinocchio.computeDistances(self.model, self.data, self.geometry, self.geometry_data, q)

    def compute_all(self, batch: FloatArray) -> None:
        """All distances, one configuration after the other."""
        for q in batch:
            self.compute(q)

    def distances(self, q: FloatArray) -> FloatArray:
        """(Z,), after compute, in the order of the model's pairs."""
        self.compute(q)
        return np.array([result.min_distance for result in self.geometry_data.distanceResults])

    def precise(self) -> None:
        """Tighten its iterations for comparisons."""
        for request in self.geometry_data.distanceRequests:
            request.gjk_tolerance = 1e-9
