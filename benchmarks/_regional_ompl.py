"""Paths by OMPL: RRTConnect and BKPIECE1 with their defaults, simplified by OMPL's PathSimplifier.

A state is valid where the project's is_free kernel finds every pair beyond its threshold, the
planner's own one. A motion is checked every 0.01 rad of its fastest joint, all states in one call
of the kernel: a validator of states alone would cost OMPL ten times the time from Python. So its
paths are sampled, not proved.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from _regional_tasks import Task
from ompl import base, geometric, util

from ir_planner.scene.planning_scene import PROOF_TOLERANCE
from ir_values.arrays import FloatArray

PLANNERS = {"RRTConnect": geometric.RRTConnect, "BKPIECE1": geometric.BKPIECE1}
RESOLUTION = 0.01  # rad of the fastest joint between two states that are checked
SEARCH_S = 1.0  # ceiling of a search
SIMPLIFY_S = 0.25  # ceiling of a simplification
BSPLINE_STEPS = 5  # OMPL's default

util.setLogLevel(util.LogLevel.LOG_NONE)
util.RNG.setSeed(
    1
)  # once in a process: what follows is the same in every run, as far as ceilings allow


@dataclass(frozen=True, eq=False)
class OmplPath:
    """A path: corners (M, n) after simplification, the same rounded off by B-splines (P, n);
    seconds.
    """

    corners: FloatArray
    smooth: FloatArray
    first_s: float
    simplify_s: float


class Free:
    """Which configurations keep the task's thresholds."""

    def __init__(self, task: Task) -> None:
        self._is_free = task.scene.collision.is_free
        self._threshold = task.scene.thresholds(task.margin) - PROOF_TOLERANCE / 2

    def all(self, q: FloatArray) -> bool:
        """Whether all of q (N, n) are free."""
        return bool(self._is_free(np.ascontiguousarray(q), self._threshold).all())

    def motion(self, q0: FloatArray, q1: FloatArray) -> bool:
        """Whether the straight movement is free at every sample, its first one left out."""
        count = max(int(np.ceil(np.abs(q1 - q0).max() / RESOLUTION)), 1)
        return self.all(q0 + np.linspace(0.0, 1.0, count + 1)[1:, None] * (q1 - q0))


class _Validator(base.MotionValidator):  # type: ignore[misc]
    """Motions by one call of the kernel each."""

    def __init__(self, information: base.SpaceInformation, free: Free, n: int) -> None:
        super().__init__(information)
        self._free = free
        self._n = n

    def checkMotion(self, first: base.State, last: base.State) -> bool:  # noqa: N802 - OMPL's name
        n = self._n
        return self._free.motion(np.array(first[0:n]), np.array(last[0:n]))


def ompl_path(task: Task, planner: str, seconds: float = SEARCH_S) -> OmplPath | None:
    """A path of one search, None where its time was up; each call draws on in OMPL's random
    numbers.
    """
    robot = task.scene.cell.robot
    n = len(task.start)
    free = Free(task)
    bounds = base.RealVectorBounds(n)
    for j in range(n):
        bounds.setLow(j, float(robot.position_min[j]))
        bounds.setHigh(j, float(robot.position_max[j]))
    space = base.RealVectorStateSpace(n)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: free.all(np.array([state[0:n]])))
    information.setMotionValidator(_Validator(information, free, n))
    ends = [space.allocState(), space.allocState()]
    for state, q in zip(ends, (task.start, task.goal), strict=True):
        state[0:n] = q.tolist()
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(PLANNERS[planner](information))
    begin = time.perf_counter()
    setup.solve(seconds)
    found_at = time.perf_counter()
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    simplifier.simplify(path, SIMPLIFY_S)
    corners = _points(path, n)
    if len(corners) > 2:
        simplifier.smoothBSpline(path, BSPLINE_STEPS)
    done = time.perf_counter()
    return OmplPath(corners, _points(path, n), found_at - begin, done - found_at)


def _points(path: geometric.PathGeometric, n: int) -> FloatArray:
    return np.array([state[0:n] for state in path.getStates()])
