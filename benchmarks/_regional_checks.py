"""Second opinions on regional movements: distances by Coal at 0.0005 rad, limits at 10 kHz, torque by
Pinocchio.
"""

from __future__ import annotations

import numpy as np
import pinocchio
from _kernels_peers import Coal

from ir_kernels.dynamics_data import STANDARD_GRAVITY
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene.planning_scene import PlanningScene

STEP = 0.0005  # rad of the fastest joint between two configurations that Coal is asked about
RATE = 10_000.0  # Hz


def sampled_densely(trajectory: JointTrajectory, step: float = STEP) -> FloatArray:
    """Configurations (M, n) along the way; no joint moves more than `step` [rad] from one to the next."""
    times = trajectory.times
    instants = np.linspace(times[0], times[-1], max(int((times[-1] - times[0]) * RATE), 2))
    way = np.abs(np.diff(trajectory.sample(instants).q, axis=0)).max(axis=1)
    passed = np.concatenate([[0.0], np.cumsum(way)])
    count = int(np.ceil(1.1 * passed[-1] / step)) + 2
    while True:
        q = trajectory.sample(np.interp(np.linspace(0.0, passed[-1], count), passed, instants)).q
        if np.abs(np.diff(q, axis=0)).max() <= step:
            return q
        count = int(1.2 * count)


class SecondOpinion:
    """Coal and Pinocchio for one scene."""

    def __init__(self, scene: PlanningScene) -> None:
        loads = [capsule for load in scene.loads for capsule in load.capsules]
        self._scene = scene
        self._coal = Coal(scene.collision, [*scene.cell.robot.capsules, *loads], scene.cell.bodies())
        self._coal.precise()
        self._arm = _arm(scene)
        self._data = self._arm.createData()

    def clearance_left(self, trajectory: JointTrajectory, margin: float) -> tuple[float, int]:
        """Least distance minus what its pair must keep [m] by Coal, and how many configurations."""
        kept, asked = self._scene.thresholds(margin), sampled_densely(trajectory)
        return min(float((self._coal.distances(q) - kept).min()) for q in asked), len(asked)

    def largest_share(self, trajectory: JointTrajectory) -> float:
        """Largest used share of position, speed, acceleration, jerk and torque limits at 10 kHz."""
        robot, times = self._scene.cell.robot, trajectory.times
        count = max(int(np.ceil((times[-1] - times[0]) * RATE)), 1) + 1
        at = trajectory.sample(np.linspace(times[0], times[-1], count))
        middle = 0.5 * (robot.position_max + robot.position_min)
        half = 0.5 * (robot.position_max - robot.position_min)
        shares = (
            (at.q - middle) / half,
            at.qd / robot.velocity_max,
            at.qdd / robot.acceleration_max,
            at.qddd / robot.jerk_max,
            self.torque(at.q, at.qd, at.qdd) / self.envelope(at.qd),
        )
        return float(max(np.abs(share).max() for share in shares))

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
        robot, limit = self._scene.cell.robot, np.empty_like(qd)
        for j, (speeds, torques) in enumerate(zip(robot.envelope_speed, robot.envelope_torque, strict=True)):
            fast = np.interp(np.abs(qd[:, j]), speeds, torques[1:])
            limit[:, j] = np.where(np.abs(qd[:, j]) < speeds[0], torques[0], fast)
        return limit

    def _counterbalance(self, q: FloatArray) -> FloatArray:
        """Force of the gas spring times its lever about the pivot's joint, from the robot's data."""
        torque, spring = np.zeros_like(q), self._scene.cell.robot.counterbalance
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


def _arm(scene: PlanningScene) -> pinocchio.Model:
    """Robot and loads as rigid bodies."""
    robot, model, parent = scene.cell.robot, pinocchio.Model(), 0
    model.gravity.linear = np.asarray(scene.cell.base_pose)[:3, :3].T @ [0.0, 0.0, -STANDARD_GRAVITY]
    for i, (origin, axis) in enumerate(zip(robot.joint_origin, robot.joint_axis, strict=True)):
        placement = pinocchio.SE3(origin[:3, :3].copy(), origin[:3, 3].copy())
        joint = pinocchio.JointModelRevoluteUnaligned(axis.copy())
        parent = model.addJoint(parent, joint, placement, f"joint_{i}")
        link = (robot.link_mass[i + 1], robot.link_com[i + 1], robot.link_inertia[i + 1])
        for mass, com, inertia in (
            link,
            *((x.mass, x.com, x.inertia) for x in scene.loads if i == robot.n - 1),
        ):
            body = pinocchio.Inertia(float(mass), np.array(com), np.array(inertia))
            model.appendBodyToJoint(parent, body, pinocchio.SE3.Identity())
    return model
