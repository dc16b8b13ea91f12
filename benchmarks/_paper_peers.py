"""One search, alone: what a planner needs until its first certified path, in checks and processor
time.

Planners of OMPL run in a process forked for each search, on the same kernel and with the same
counting as behind `planner_id`. Their processor time counts from their first check to their last:
what it takes to set up OMPL's problem in a new process (2 ms, as much as an easy search) is no
property of a planner, and would make all of their times alike. The project's own searches run here.
"""

from __future__ import annotations

import math
import multiprocessing
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import cast

import numpy as np
from ompl import util

from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.scene import PlanningScene, path_cost
from ir_planner.search import SEARCHES, Ends, fewest_corners, pulled
from ir_planner.search.with_ompl import worker
from ir_planner.search.with_ompl.host import OmplParameters, OmplProblem
from ir_planner.search.with_ompl.planners import OmplSearch
from ir_values.arrays import FloatArray

LATE_S = 60.0  # of wall time: a search that hangs is ended
_FORK = multiprocessing.get_context("fork")  # the scene is large, and OMPL is loaded only once


@dataclass(frozen=True, eq=False)
class Question:
    """From start to goal (n,) where every pair keeps `margin` [m]."""

    scene: PlanningScene
    start: FloatArray
    goal: FloatArray
    margin: float

    def space(self, edges: int) -> FreeSpace:
        """Free space with so many certified edges to spend."""
        return FreeSpace.of(self.scene, self.margin, Work(edges, np.inf, time.monotonic))

    def straight_is_free(self) -> bool:
        """Whether nothing has to be searched."""
        return bool(self.space(1).edges_free(self.start[None], self.goal[None])[0])


@dataclass(frozen=True, eq=False)
class Found:
    """Whether a path was found, checks in edges, seconds of processor time, W of the path when
    shortened.
    """

    solved: bool
    edges: int
    seconds: float
    W: float


def searched(
    name: str, question: Question, seed: int, edges: int, cell: float | None = None
) -> Found:
    """One search by the planner of that name with `edges` to spend. cell [rad]: of KPIECE's grid,
    None: its default.
    """
    search = SEARCHES[name]
    if isinstance(search, OmplSearch):
        cells = search.cells() if cell is None else cell
        parameters = OmplParameters(search.planner, search.parameters(), cells)
        return _forked(question, parameters, seed, edges)
    # the models are there before the clock starts
    space = question.space(edges)
    _ = question.scene.weights
    space.states_free(question.start[None])
    begin = time.process_time()
    found = search.find(Ends(question.start, question.goal[None]), space, seed)
    seconds = time.process_time() - begin
    path = found.paths[0] if found.paths else None
    return Found(path is not None, space.work.iterations, seconds, _cost(path, question))


def _cost(path: FloatArray | None, question: Question) -> float:
    if path is None:
        return float("nan")
    space = question.space(100_000)
    weights = question.scene.weights
    return path_cost(weights, pulled(fewest_corners(path, space, weights), space, weights))


def _forked(question: Question, parameters: OmplParameters, seed: int, edges: int) -> Found:
    threshold = question.space(1).threshold
    goals = question.goal[None]
    problem = OmplProblem(
        question.scene, threshold, question.start, goals, parameters, seed, edges, LATE_S
    )
    question.scene.collision.is_free(goals, threshold)  # the models are there before the fork
    ours, theirs = _FORK.Pipe()
    process = _FORK.Process(target=_solve, args=(problem, theirs))
    process.start()
    theirs.close()
    try:
        if not ours.poll(LATE_S):
            return Found(False, edges, LATE_S, float("nan"))
        path, spent, seconds = cast(tuple[FloatArray | None, int, float], ours.recv())
    except EOFError:
        return Found(False, edges, LATE_S, float("nan"))
    finally:
        process.kill()
        process.join()
        ours.close()
    return Found(path is not None, spent, seconds, _cost(path, question))


def _solve(problem: OmplProblem, connection: Connection) -> None:
    util.setLogLevel(util.LogLevel.LOG_NONE)
    clock = Clock()
    for check in ("state", "motion"):
        setattr(worker._Counted, check, clock.timed(getattr(worker._Counted, check)))
    outcome = worker.solved(replace(problem), connection)
    connection.send((outcome.path, outcome.edges, clock.seconds))
    connection.recv()  # until it is killed: OMPL's destructors complain


class Clock:
    """Seconds of processor time from the first call of a function to the end of its last."""

    def __init__(self, now: Callable[[], float] = time.process_time) -> None:
        self._now = now
        self._first = math.nan
        self._last = math.nan

    @property
    def seconds(self) -> float:
        """Zero before the first call."""
        return 0.0 if math.isnan(self._first) else self._last - self._first

    def timed(self, function: Callable[..., bool]) -> Callable[..., bool]:
        """The function, its calls timed."""

        def called(*given: object) -> bool:
            if math.isnan(self._first):
                self._first = self._now()
            answer = function(*given)
            self._last = self._now()
            return answer

        return called
