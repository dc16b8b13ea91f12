"""The descent of eqs. (2) and (3) against one that knows nothing but Pinocchio's pose of the
tool.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio

from ir_description import robot_urdf
from ir_planner.configurations.ccd_search import InteractionSettings, descend
from ir_planner.configurations.interaction_point import random_starts
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PlanningScene
from ir_values.arrays import FloatArray

SWEEPS = 6
THIRDS = np.array([0.0, 2.0, 4.0]) * np.pi / 3.0


def psi_of(scene: PlanningScene, pose: FloatArray) -> Callable[[FloatArray], float]:
    """Eq. (2) as written, lambda = 0.5 m/rad."""
    cell = scene.cell
    model = pinocchio.buildModelFromXML(robot_urdf(cell.robot, scene.loads, cell.tcp))
    data = model.createData()
    tcp = model.getFrameId("tcp")
    goal = np.linalg.inv(cell.base_pose) @ pose

    def psi(q: FloatArray) -> float:
        pinocchio.framesForwardKinematics(model, data, q)
        at = data.oMf[tcp]
        turn = at.rotation - goal[:3, :3]
        return float(((at.translation - goal[:3, 3]) ** 2).sum() + 0.125 * (turn**2).sum())

    return psi


def swept(
    q: FloatArray, psi: Callable[[FloatArray], float], low: FloatArray, high: FloatArray
) -> FloatArray:
    """One sweep, tool to base: Psi over one angle is a + b cos + c sin, which three of its values
    fix.
    """
    q = q.copy()
    for i in reversed(range(len(q))):

        def at(angle: float, i: int = i) -> float:
            return psi(np.array([*q[:i], angle, *q[i + 1 :]]))

        three = np.array([at(angle) for angle in THIRDS])
        least = np.arctan2(-(three @ np.sin(THIRDS)), -(three @ np.cos(THIRDS)))
        turns = least + 2.0 * np.pi * np.arange(-2, 3)
        within = turns[(turns >= low[i]) & (turns <= high[i])]
        ends = (float(low[i]), float(high[i]))
        q[i] = within[np.argmin(np.abs(within - q[i]))] if len(within) else min(ends, key=at)
    return q


def test_every_sweep_of_the_descent_is_that_of_three_values_per_joint(
    scene_of: Callable[[str], PlanningScene], budget: Work
) -> None:
    scene = scene_of("cnc_door")
    pose = scene.station("press").pose
    robot = scene.cell.robot
    low = robot.position_min
    high = robot.position_max
    starts = random_starts(low, high, 8, "uniform", np.random.default_rng(3))
    chosen = InteractionSettings(set_back="none", newton_steps=0, sweeps=SWEEPS, xi=1e-16)
    found = descend(pose, starts, scene, scene.thresholds(0.02, "press"), chosen, budget)
    psi = psi_of(scene, pose)
    for start, track in zip(starts, found.tracks, strict=True):
        q = start
        for reached in track[1:]:
            q = swept(q, psi, low, high)
            np.testing.assert_allclose(reached, q, atol=1e-6)
        assert len(track) == SWEEPS + 1
