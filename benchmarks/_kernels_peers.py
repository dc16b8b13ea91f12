"""The same cell in Coal through Pinocchio and in PyBullet: what the kernels are measured
against.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pybullet

from ir_description import Cell, robot_urdf
from ir_kernels import CollisionModel
from ir_values.arrays import FloatArray


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
