"""Second opinions on movements: distances by Coal at 0.0005 rad, limits at 10 kHz, torque by
Pinocchio.
"""

from __future__ import annotations

import numpy as np
from _coal_refined import RefinedCoal
from _drives import Drives
from _kernels_peers import Coal

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.scene.zones import tcp_inside

STEP = 0.0005  # rad of the fastest joint between two configurations that Coal is asked about
RATE = 10_000.0  # Hz


def sampled_densely(trajectory: JointTrajectory, step: float = STEP) -> FloatArray:
    """Configurations (M, n) along the path; no joint moves more than `step` [rad] from one to the
    next.
    """
    times = trajectory.times
    instants = np.linspace(times[0], times[-1], max(int((times[-1] - times[0]) * RATE), 2))
    steps = np.abs(np.diff(trajectory.sample(instants).q, axis=0)).max(axis=1)
    passed = np.concatenate([[0.0], np.cumsum(steps)])
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
        capsules = [*scene.cell.robot.capsules, *loads]
        self._coal = Coal(scene.collision, capsules, scene.cell.bodies())
        self._coal.precise()
        self._refined = RefinedCoal(self._coal, scene.collision, scene.cell.robot, capsules)
        self._drives = Drives(scene)

    def clearance_left(
        self, trajectory: JointTrajectory, margin: float, station: str = "", step: float = STEP
    ) -> tuple[float, int]:
        """Least distance minus what its pair must keep [m] by Coal, exact where it is negative, and
        at how many configurations it was asked.

        station: inside its zone its allowed contacts keep their own distances.
        """
        asked = sampled_densely(trajectory, step)
        plain = self._scene.thresholds(margin)
        kept = np.broadcast_to(plain, (len(asked), len(plain)))
        if station:
            inside = tcp_inside(asked, self._scene, station, margin)
            kept = np.where(inside[:, None], self._scene.thresholds(margin, station), plain)
        return self._refined.least(asked, kept)

    def least_distance(self, trajectory: JointTrajectory) -> tuple[float, int]:
        """Least distance of all pairs [m] by Coal, and at how many configurations."""
        asked = sampled_densely(trajectory)
        return min(float(self._coal.distances(q).min()) for q in asked), len(asked)

    def largest_share(self, trajectory: JointTrajectory) -> float:
        """Largest used share of position, speed, acceleration, jerk and torque limits at 10 kHz."""
        robot = self._scene.cell.robot
        times = trajectory.times
        count = max(int(np.ceil((times[-1] - times[0]) * RATE)), 1) + 1
        at = trajectory.sample(np.linspace(times[0], times[-1], count))
        middle = 0.5 * (robot.position_max + robot.position_min)
        half = 0.5 * (robot.position_max - robot.position_min)
        shares = (
            (at.q - middle) / half,
            at.qd / robot.velocity_max,
            at.qdd / robot.acceleration_max,
            at.qddd / robot.jerk_max,
            self._drives.torque(at.q, at.qd, at.qdd) / self._drives.envelope(at.qd),
        )
        return float(max(np.abs(share).max() for share in shares))
