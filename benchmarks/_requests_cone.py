"""A tool that stays upright, within 5 to 60 deg, on free movements in four cells of two robots.

The judge is Pinocchio: the tilt at samples 1 ms apart. What is refused is put to OMPL's RRTConnect
among upright states, by rejection, with motions looked at every 0.01 rad. The peer in J is the same
movement that may lean as it likes: what the tilt costs.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio
from _pinocchio_arm import pinocchio_arm
from _requests_rows import NOT_ASKED, Row

from ir_planner import Planner
from ir_planner.scene import ToolCone
from ir_values.arrays import FloatArray

CELLS = ("open", "table_columns", "cnc_door", "kr6_bench")
DEGREES = (5.0, 10.0, 20.0, 60.0)
SAMPLE_S = 1e-3
PEER_S = 2.0  # ceiling of its search
RESOLUTION = 0.01  # rad
TOLERANCE = 1.1e-6  # rad
UP = np.array([0.0, 0.0, 1.0])
_DOWN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


class _Judge:
    """Where the tool points, by Pinocchio."""

    def __init__(self, planner: Planner) -> None:
        cell = planner.cell
        self._model = pinocchio_arm(cell.robot)
        self._data = self._model.createData()
        self._base = np.asarray(cell.base_pose)[:3, :3]
        self._tool = np.asarray(cell.tcp)[:3, :3]

    def rotation(self, q: FloatArray) -> FloatArray:
        """(3, 3) of the tcp in the cell at q (n,)."""
        pinocchio.forwardKinematics(self._model, self._data, q)
        last: FloatArray = self._data.oMi[self._model.njoints - 1].rotation
        return np.asarray(self._base @ last @ self._tool)

    def largest(self, trajectory: Any, axis: FloatArray) -> float:
        """The largest angle [rad] of an axis of the tool to the vertical along a trajectory."""
        count = int(trajectory.duration / SAMPLE_S) + 2
        tilts = []
        for q in trajectory.sample(np.linspace(0.0, trajectory.duration, count)).q:
            leaning = self.rotation(q) @ axis
            tilts.append(np.arctan2(np.linalg.norm(np.cross(leaning, UP)), leaning @ UP))
        return float(np.max(tilts))


def _upright(planner: Planner, rng: np.random.Generator) -> FloatArray:
    """A free pose (4, 4) of the tool that points down."""
    robot = planner.cell.robot
    reach = float(np.abs(robot.joint_origin[1:, :3, 3]).sum())
    base = np.asarray(planner.cell.base_pose)[:3, 3]
    while True:
        around, yaw = rng.uniform(-np.pi, np.pi, 2)
        radius = rng.uniform(0.3, 0.7) * reach
        c = np.cos(yaw)
        s = np.sin(yaw)
        pose = np.eye(4)
        pose[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ _DOWN
        place = (radius * np.cos(around), radius * np.sin(around), rng.uniform(0.1, 0.5) * reach)
        pose[:3, 3] = base + np.array(place)
        if planner.compute_ik(pose).solutions:
            return pose


def _peer_finds(planner: Planner, start: FloatArray, goal: FloatArray, most: float) -> bool:
    """Whether OMPL's RRTConnect finds a path among upright, free states."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    scene = planner.scene()
    axis = scene.chain.tcp_poses(start[None])[0, :3, :3].T @ UP
    cone = ToolCone(scene.chain, axis, UP, most)
    threshold = scene.thresholds(0.02)
    n = len(start)
    space = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    for j in range(n):
        bounds.setLow(j, float(scene.cell.robot.position_min[j]))
        bounds.setHigh(j, float(scene.cell.robot.position_max[j]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()

    def valid(state: Any) -> bool:
        q = np.array(state[0:n])[None]
        return bool(cone.holds(q)[0] and scene.collision.is_free(q, threshold)[0])

    setup.setStateValidityChecker(valid)
    information.setStateValidityCheckingResolution(RESOLUTION / space.getMaximumExtent())
    ends = []
    for q in (start, goal):
        state = space.allocState()
        for j in range(n):
            state[j] = float(q[j])
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(geometric.RRTConnect(information))
    setup.solve(PEER_S)
    return bool(setup.haveExactSolutionPath())


def rows(count: int) -> Iterator[Row]:
    """So many cases, a cell after the other."""
    planners = [Planner(cell) for cell in CELLS]
    judges = [_Judge(planner) for planner in planners]
    for case in range(count):
        rng = np.random.default_rng([case, 5])
        planner = planners[case % len(CELLS)]
        judge = judges[case % len(CELLS)]
        degrees = DEGREES[int(rng.integers(len(DEGREES)))]
        most = float(np.radians(degrees))
        start = np.array(planner.compute_ik(_upright(planner, rng)).solutions[0].q)
        goal = _upright(planner, rng)
        began = time.process_time()
        plan = planner.plan_regional(start=start, goal=goal, tilt_max=most)
        seconds = time.process_time() - began
        name = f"{CELLS[case % len(CELLS)]}, {degrees:g} deg, case {case}"
        if plan.trajectory is None:
            ends = [np.array(found.q) for found in planner.compute_ik(goal, near=start).solutions]
            peer = any(_peer_finds(planner, start, end, most) for end in ends[:3])
            why = f"{degrees:g} deg: {plan.status.message.split(':')[0][:80]}"
            yield Row(name, why, False, (), seconds, peer_only=peer)
            continue
        seen = judge.largest(plan.trajectory, judge.rotation(start).T @ UP)
        wrong = []
        if seen > most + TOLERANCE:
            wrong.append("the tool leans farther than asked")
        if seen > plan.report.largest_tilt + TOLERANCE:
            wrong.append("the tool leans farther than reported")
        free = planner.plan_regional(start=start, goal=plan.trajectory.positions[-1])
        report = plan.report
        joules = [
            found.energy - found.base_energy + planner.cell.robot.time_value * found.duration
            for found in (report, free.report)
        ]
        peer_joules = joules[1] if free.status.ok else NOT_ASKED
        yield Row(name, "", report.certified, tuple(wrong), seconds, joules[0], peer_joules)
