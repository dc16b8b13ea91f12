"""The drives once more, independent of the compiled core: torque by Pinocchio, power, energy at the
mains.

Arm and loads are Pinocchio's; rotors, friction, the gas spring, copper losses and the DC link
follow from the description's data.
"""

from __future__ import annotations

import numpy as np
import pinocchio
from _pinocchio_arm import pinocchio_arm

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

STEP_S = 1e-3


class Drives:
    """Arm, loads and drives of one scene."""

    def __init__(self, scene: PlanningScene) -> None:
        self._scene = scene
        self._arm = pinocchio_arm(scene.cell.robot, scene.loads, scene.cell.base_pose)
        self._data = self._arm.createData()

    def torque(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Motor torque (N, n) Nm: Pinocchio's arm, rotors and friction, less the counterbalance."""
        robot = self._scene.cell.robot
        arm = np.array(
            [pinocchio.rnea(self._arm, self._data, *x).copy() for x in zip(q, qd, qdd, strict=True)]
        )
        friction = robot.friction_viscous * qd + robot.friction_coulomb * np.sign(qd)
        return arm + robot.reflected_inertia * qdd + friction - self._counterbalance(q)

    def envelope(self, qd: FloatArray) -> FloatArray:
        """Torque (N, n) Nm that gear and motor have at these speeds."""
        robot = self._scene.cell.robot
        limit = np.empty_like(qd)
        for j, (speeds, torques) in enumerate(
            zip(robot.envelope_speed, robot.envelope_torque, strict=True)
        ):
            fast = np.interp(np.abs(qd[:, j]), speeds, torques[1:])
            limit[:, j] = np.where(np.abs(qd[:, j]) < speeds[0], torques[0], fast)
        return limit

    def energy(self, trajectory: JointTrajectory, step: float = STEP_S) -> float:
        """Drive energy [J] at the mains; the capacitor starts empty, what is left in it is not
        credited.
        """
        span = float(trajectory.times[-1] - trajectory.times[0])
        count = max(int(np.ceil(span / step - 1e-9)), 1)
        dt = span / count
        at = trajectory.sample(trajectory.times[0] + (np.arange(count) + 0.5) * dt)
        torque = self.torque(at.q, at.qd, at.qdd)
        robot = self._scene.cell.robot
        power = torque * at.qd + robot.copper_loss * (torque / robot.gear_ratio) ** 2
        return self.mains(power.sum(axis=1) * dt)

    def mains(self, wanted: FloatArray) -> float:
        """Energy [J] from the mains for joules (N,) that the axes want together, step by step."""
        capacity = self._scene.power.dc_link_capacity_energy
        stored = 0.0
        drawn = 0.0
        for joules in wanted:
            drawn += max(float(joules) - stored, 0.0)
            stored = min(max(stored - float(joules), 0.0), capacity)
        return drawn

    def _counterbalance(self, q: FloatArray) -> FloatArray:
        """Force of the gas spring times its lever about the pivot's joint, from the robot's
        data.
        """
        torque = np.zeros_like(q)
        spring = self._scene.cell.robot.counterbalance
        if spring is None:
            return torque
        angle = q[:, spring.joint]
        x = np.cos(angle) * spring.rod_eye[0] + np.sin(angle) * spring.rod_eye[1]
        z = np.cos(angle) * spring.rod_eye[1] - np.sin(angle) * spring.rod_eye[0]
        rod = np.stack([x - spring.pivot[0], z - spring.pivot[1]])
        length = np.linalg.norm(rod, axis=0)
        volume = spring.gas_volume - spring.piston_area * (length - spring.rod_length_at_charge)
        pressure = spring.charge_pressure * (spring.gas_volume / volume) ** spring.exponent
        force = pressure * spring.piston_area * rod / length  # on the rod eye, away from the pivot
        pull = -force
        torque[:, spring.joint] = z * pull[0] - x * pull[1]  # about +y
        return torque
