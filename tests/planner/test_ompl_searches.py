"""OMPL's planners as searches: late ones are killed, blocked paths repaired, a missing OMPL
named.
"""

from __future__ import annotations

import itertools
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from asking import planned

from ir_kernels.collision import FREE
from ir_planner import CancelledError, PlanOptions, RequestError
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.scene import PlanningScene
from ir_planner.search import SEARCHES, Ends, with_ompl
from ir_planner.search.with_ompl import host
from ir_planner.search.with_ompl import planners as adapter
from ir_planner.search.with_ompl.host import OmplAnswer, OmplParameters, OmplProblem
from ir_planner.search.with_ompl.planners import repaired

SceneOf = Callable[[str], PlanningScene]
S_M = 0.02


def a_blocked_task(scene_of: SceneOf, work: Work) -> tuple[Ends, FreeSpace]:
    scene = scene_of("table_columns")
    task = scene.cell.task("tL->tR")
    return Ends(np.array(task.start), np.array([task.goal])), FreeSpace.of(scene, S_M, work)


def test_without_ompl_a_sentence_says_how_to_install_it(
    scene_of: SceneOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(host, "find_spec", lambda name: None)
    ends, space = a_blocked_task(scene_of, Work(1000, 1.0, lambda: 0.0))
    with pytest.raises(RequestError, match="'kpiece': OMPL is missing: pip install"):
        SEARCHES["kpiece"].find(ends, space, 1)


def test_ompl_that_is_installed_but_broken_is_no_search_that_found_nothing(
    scene_of: SceneOf, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "ompl").mkdir()
    (tmp_path / "ompl" / "__init__.py").write_text("raise ImportError('libompl.so is damaged')\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(host, "_host", None)  # as it was, afterwards
    ends, space = a_blocked_task(scene_of, Work(1000, 1.0, lambda: 0.0))
    try:
        with pytest.raises(
            RequestError, match=r"'rrt': OMPL is installed but can't be loaded: libompl.so"
        ):
            SEARCHES["rrt"].find(ends, space, 1)
    finally:
        if host._host is not None:
            host._host.close()


CHECKED_BY = """
import multiprocessing, os, pickle, sys, threading
from ir_planner.search.with_ompl import worker

class Checked(worker._Counted):
    def motion(self, first, last):
        threads.add(threading.get_ident())
        return super().motion(first, last)

threads, worker._Counted = set(), Checked
connection, other = multiprocessing.Pipe()
worker.util.setLogLevel(worker.util.LogLevel.LOG_NONE)
worker.solved(pickle.load(sys.stdin.buffer), connection)
print(threads == {threading.get_ident()}, flush=True)
os._exit(0)  # without destructors, as the worker
"""


def test_a_roadmap_to_several_goals_is_checked_in_one_thread(scene_of: SceneOf) -> None:
    """Checks are made with Python's lock: in a second thread they can wait for the first for
    ever.
    """
    ends, space = a_blocked_task(scene_of, Work(1000, 1.0, lambda: 0.0))
    goals = np.concatenate([ends.goals, ends.goals - 0.05, ends.goals + 0.05])
    parameters = OmplParameters("PRM", reverse=with_ompl.Prm.reverse)
    scene = replace(space.scene)  # without what it has computed
    problem = OmplProblem(scene, space.threshold, ends.start, goals, parameters, 1, 2000, 9.0)
    command = [sys.executable, "-c", CHECKED_BY]
    ran = subprocess.run(
        command, input=pickle.dumps(problem), capture_output=True, check=False, timeout=300.0
    )
    assert ran.stdout == b"True\n", (ran.returncode, ran.stderr.decode())


def test_a_roadmap_to_several_goals_leads_from_the_start_to_one_of_them(scene_of: SceneOf) -> None:
    ends, space = a_blocked_task(scene_of, Work(100_000, 1.0, lambda: 0.0))
    ends = Ends(ends.start, np.concatenate([ends.goals, ends.goals - 0.01]))
    (path,) = SEARCHES["prm"].find(ends, space, 1).paths
    assert np.array_equal(path[0], ends.start)
    assert any(np.array_equal(path[-1], goal) for goal in ends.goals)


def test_at_the_ceiling_it_is_killed(scene_of: SceneOf) -> None:
    """The clock reaches the deadline while OMPL searches; RRT would need minutes for its checks."""
    ticks: Iterator[float] = itertools.count(0.0, 0.1)
    ends, space = a_blocked_task(scene_of, Work(10_000_000, 1.0, ticks.__next__))
    ends = Ends(
        ends.start, ends.goals + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 50.0])
    )  # beyond every range
    found = SEARCHES["rrt"].find(ends, space, 1)
    assert found.paths == []
    assert space.work.truncated


def test_each_process_is_charged_while_it_is_there(
    scene_of: SceneOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    charged: list[int] = []

    @contextmanager
    def charge(process: int) -> Iterator[None]:
        os.kill(process, 0)
        yield
        os.kill(process, 0)  # not killed before it was charged
        charged.append(process)

    monkeypatch.setattr(host, "_charged", host._charged)  # as it was, afterwards
    with_ompl.charge_to(charge)
    ends, space = a_blocked_task(scene_of, Work(10_000, 1.0, lambda: 0.0))
    for seed in range(2):
        assert SEARCHES["rrt_connect"].find(ends, space, seed).paths
    assert len(set(charged)) == 2


def test_a_request_that_is_cancelled_meanwhile_raises(scene_of: SceneOf) -> None:
    looks = itertools.count()
    work = Work(10_000_000, 1.0, lambda: 0.0, lambda: next(looks) > 3)
    ends, space = a_blocked_task(scene_of, work)
    with pytest.raises(CancelledError):
        SEARCHES["rrt"].find(Ends(ends.start, ends.goals + 50.0), space, 1)


def test_a_process_that_dies_is_an_answer_without_a_path(
    scene_of: SceneOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_planner(problem: OmplProblem, work: Work) -> OmplAnswer:
        return asked(OmplProblem(**{**vars(problem), "parameters": "no parameters"}), work)

    asked = adapter.asked
    monkeypatch.setattr(adapter, "asked", no_planner)
    ends, space = a_blocked_task(scene_of, Work(1000, 1.0, lambda: 0.0))
    found = with_ompl.Rrt().find(ends, space, 1)
    assert found.paths == []
    assert "AttributeError" in found.note


def test_a_path_that_is_blocked_between_its_points_is_repaired_or_refused(
    scene_of: SceneOf,
) -> None:
    ends, space = a_blocked_task(scene_of, Work(100_000, 1.0, lambda: 0.0))
    straight = np.stack([ends.start, ends.goals[0]])
    assert space.certificates(straight[:1], straight[1:]).verdict[0] != FREE
    path = repaired(straight, space, 1)
    assert path is not None
    assert len(path) > 2
    assert np.array_equal(path[[0, -1]], straight)
    assert (space.certificates(path[:-1].copy(), path[1:].copy()).verdict == FREE).all()
    beyond = a_blocked_task(scene_of, Work(2, 1.0, lambda: 0.0))[1]
    assert repaired(straight, beyond, 1) is None


def test_what_ompl_answers_is_never_returned_unchecked(
    scene_of: SceneOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends, space = a_blocked_task(scene_of, Work(100_000, 1.0, lambda: 0.0))
    straight = np.stack([ends.start, ends.goals[0]])
    monkeypatch.setattr(adapter, "asked", lambda problem, work: OmplAnswer(straight, 1))
    (path,) = with_ompl.Rrt().find(ends, space, 1).paths
    assert (space.certificates(path[:-1].copy(), path[1:].copy()).verdict == FREE).all()


@pytest.mark.parametrize("allowed", [1, 40, 700])
def test_max_iterations_is_never_exceeded(allowed: int, scene_of: SceneOf) -> None:
    scene = scene_of("table_columns")
    task = scene.cell.tasks[0]
    work = Work(allowed, 1.0, lambda: 0.0, improvement=allowed)
    options = PlanOptions(planner_id="bkpiece")
    plan = planned(np.array(task.start), np.array(task.goal), scene, options, work)
    assert plan.info.iterations <= allowed
    assert not plan.info.truncated
