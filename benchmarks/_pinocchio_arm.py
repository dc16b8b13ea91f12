"""The robot with its loads as rigid bodies in Pinocchio, built from the description alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio

from ir_description import RobotModel
from ir_kernels.dynamics_data import STANDARD_GRAVITY
from ir_values.arrays import FloatArray


def pinocchio_arm(
    robot: RobotModel, loads: Sequence[Any] = (), base_pose: FloatArray | None = None
) -> pinocchio.Model:
    """Links and loads without rotors and friction; base_pose (4, 4) of the robot in the cell."""
    model = pinocchio.Model()
    parent = 0
    turn = np.eye(3) if base_pose is None else np.asarray(base_pose)[:3, :3]
    model.gravity.linear = turn.T @ [0.0, 0.0, -STANDARD_GRAVITY]
    for i, (origin, axis) in enumerate(zip(robot.joint_origin, robot.joint_axis, strict=True)):
        placement = pinocchio.SE3(origin[:3, :3].copy(), origin[:3, 3].copy())
        joint = pinocchio.JointModelRevoluteUnaligned(axis.copy())
        parent = model.addJoint(parent, joint, placement, f"joint_{i}")
        link = (robot.link_mass[i + 1], robot.link_com[i + 1], robot.link_inertia[i + 1])
        held = [(load.mass, load.com, load.inertia) for load in loads if i == robot.n - 1]
        for mass, com, inertia in (link, *held):
            body = pinocchio.Inertia(float(mass), np.array(com), np.array(inertia))
            model.appendBodyToJoint(parent, body, pinocchio.SE3.Identity())
    return model
