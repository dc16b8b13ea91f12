"""Torques by Pinocchio, where it is installed: a second opinion on those of `arm`."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from ir_description import Load, RobotModel
from ir_msgs_py.arrays import FloatArray
from ir_recorder.measure.arm import GRAVITY, ArmTorques, spring_torque


def available() -> bool:
    """Whether Pinocchio is installed."""
    return find_spec("pinocchio") is not None


def pinocchio_torques(
    robot: RobotModel, loads: Sequence[Load], base_pose: FloatArray, motion: FloatArray
) -> ArmTorques:
    """The same as `arm_torques` at motion (3, N, n); what the loads ask for counts among the
    links.
    """
    import pinocchio

    q, _, qdd = motion
    model = pinocchio.Model()
    parent = 0
    model.gravity.linear = np.asarray(base_pose)[:3, :3].T @ [0.0, 0.0, -GRAVITY]
    for i, (origin, axis) in enumerate(zip(robot.joint_origin, robot.joint_axis, strict=True)):
        place = pinocchio.SE3(origin[:3, :3].copy(), origin[:3, 3].copy())
        joint = pinocchio.JointModelRevoluteUnaligned(axis.copy())
        parent = model.addJoint(parent, joint, place, f"joint_{i}")
        bodies = [(robot.link_mass[i + 1], robot.link_com[i + 1], robot.link_inertia[i + 1])]
        bodies += [(load.mass, load.com, load.inertia) for load in loads if i == robot.n - 1]
        for mass, com, inertia in bodies:
            body = pinocchio.Inertia(float(mass), np.array(com), np.array(inertia))
            model.appendBodyToJoint(parent, body, pinocchio.SE3.Identity())
    data = model.createData()
    rows = [pinocchio.rnea(model, data, *row).copy() for row in motion.transpose(1, 0, 2)]
    torque = np.array(rows).reshape(q.shape)
    return ArmTorques(
        torque, np.zeros_like(q), qdd * robot.reflected_inertia, spring_torque(robot, q)
    )
