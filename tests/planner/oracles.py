"""Second opinions for the planner's tests: torques by Pinocchio and the data's own formulas."""

from __future__ import annotations

import numpy as np
import pinocchio
from numpy.typing import NDArray

from ir_description import RobotModel, robot_urdf
from ir_planner.scene.planning_scene import PlanningScene

FloatArray = NDArray[np.float64]


def counterbalance(robot: RobotModel, a2: FloatArray) -> FloatArray:
    """Torque about +A2 [Nm] by the formula of the machine data."""
    data = robot.counterbalance
    assert data is not None
    x, z = data.rod_eye
    eye = np.stack([x * np.cos(a2) + z * np.sin(a2), -x * np.sin(a2) + z * np.cos(a2)], axis=1)
    rod = np.asarray(data.pivot) - eye
    length = np.linalg.norm(rod, axis=1)
    volume = data.gas_volume - data.piston_area * (length - data.rod_length_at_charge)
    force = data.piston_area * data.charge_pressure * (data.gas_volume / volume) ** data.exponent
    direction = rod / length[:, None]
    return np.asarray(force * (eye[:, 1] * direction[:, 0] - eye[:, 0] * direction[:, 1]))


def torques(scene: PlanningScene, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
    """Motor torque at the joint (N, n) Nm."""
    robot = scene.cell.robot
    model = pinocchio.buildModelFromXML(robot_urdf(robot, scene.loads, scene.cell.tcp))
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    data = model.createData()
    arm = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    friction = robot.friction_viscous * qd + robot.friction_coulomb * np.sign(qd)
    total = arm + robot.reflected_inertia * qdd + friction
    total[:, 1] -= counterbalance(robot, q[:, 1])
    return np.asarray(total)


def torque_available(robot: RobotModel, qd: FloatArray) -> FloatArray:
    """The envelope (N, n) Nm as the data describe it."""
    result = np.empty_like(qd)
    for j in range(qd.shape[1]):
        speed = robot.envelope_speed[j]
        torque = robot.envelope_torque[j]
        fast = np.interp(np.abs(qd[:, j]), speed, torque[1:])
        result[:, j] = np.where(np.abs(qd[:, j]) < speed[0], torque[0], fast)
    return result
