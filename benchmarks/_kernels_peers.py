"""The same cell in Coal through Pinocchio and in PyBullet: what the kernels are measured
against.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio
import pybullet
from _coal_shapes import along_z, solid

from ir_description import Cell, robot_urdf
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


class Bullet:
    """The robot's URDF and the cell's bodies in PyBullet; closest points of all of them."""

    def __init__(self, cell: Cell, model: CollisionModel, bodies: Sequence[Any]) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(robot_urdf(cell.robot, cell.tool, cell.tcp))
            flags = pybullet.URDF_USE_SELF_COLLISION
            self.robot = pybullet.loadURDF(
                str(path), useFixedBase=True, flags=flags, physicsClientId=self.client
            )
        joints = range(pybullet.getNumJoints(self.robot, physicsClientId=self.client))
        kinds = [
            pybullet.getJointInfo(self.robot, j, physicsClientId=self.client)[2] for j in joints
        ]
        self.joints = [j for j, kind in enumerate(kinds) if kind == pybullet.JOINT_REVOLUTE]
        self.bodies = [self._body(body) for body in bodies]
        links = {
            pybullet.getJointInfo(self.robot, j, physicsClientId=self.client)[12].decode(): j
            for j in joints
        }
        tool = links.get(f"load_{cell.tool.name}", -1) if cell.tool else -1
        link = {c.name: links.get(cell.robot.link_names[c.link], -1) for c in cell.robot.capsules}
        own = {
            (link.get(pair.body_a, tool), link.get(pair.body_b, tool))
            for pair in model.pairs
            if pair.kind == "SELF"
        }
        self.own = sorted(own)

    def _body(self, body: Any) -> int:
        make = pybullet.createCollisionShape
        client = self.client
        if body.kind == "box":
            shape = make(
                pybullet.GEOM_BOX, halfExtents=list(body.size / 2.0), physicsClientId=client
            )
        elif body.kind == "cylinder":
            shape = make(
                pybullet.GEOM_CYLINDER,
                radius=body.size[0],
                height=body.size[1],
                physicsClientId=client,
            )
        elif body.kind == "sphere":
            shape = make(pybullet.GEOM_SPHERE, radius=body.size[0], physicsClientId=client)
        elif body.kind == "capsule":
            shape = make(
                pybullet.GEOM_CAPSULE,
                radius=body.size[0],
                height=body.size[1],
                physicsClientId=client,
            )
        elif body.kind == "plane":
            shape = make(pybullet.GEOM_PLANE, physicsClientId=client)
        else:
            shape = make(
                pybullet.GEOM_MESH, vertices=body.vertices.tolist(), physicsClientId=client
            )
        quaternion = pinocchio.Quaternion(np.ascontiguousarray(body.pose[:3, :3])).coeffs()
        return int(
            pybullet.createMultiBody(
                0.0, shape, -1, list(body.pose[:3, 3]), list(quaternion), physicsClientId=client
            )
        )

    def compute(self, q: FloatArray) -> float:
        """The least distance of robot and bodies at one configuration."""
        for joint, value in zip(self.joints, q, strict=True):
            pybullet.resetJointState(self.robot, joint, value, physicsClientId=self.client)
        nearest = np.inf
        for body in self.bodies:
            for point in pybullet.getClosestPoints(
                self.robot, body, 10.0, physicsClientId=self.client
            ):
                nearest = min(nearest, point[8])
        for a, b in self.own:
            found = pybullet.getClosestPoints(
                self.robot,
                self.robot,
                10.0,
                linkIndexA=a,
                linkIndexB=b,
                physicsClientId=self.client,
            )
            nearest = min(nearest, *(point[8] for point in found))
        return nearest
