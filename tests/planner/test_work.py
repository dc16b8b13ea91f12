"""A request costs no more work than it allows."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import pytest
from asking import planned

from ir_msgs_py.options import PlanOptions
from ir_planner.checks import FreeSpace
from ir_planner.program.movements import mapped
from ir_planner.regional import search_regional
from ir_planner.regional.companions import LATE, with_own_laws
from ir_planner.request.context import Context, Journal, Work
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.search import SEARCHES, Ends
from ir_planner.search.with_ompl import needs_ompl

SceneOf = Callable[[str], PlanningScene]


# OMPL's planners have a test of their own, test_ompl_searches.py
OWN = [name for name, search in SEARCHES.items() if not needs_ompl(search)]


@pytest.mark.sampled
@pytest.mark.parametrize("planner_id", ["", *OWN])
@pytest.mark.parametrize("allowed", [1, 40, 700, 1500])
def test_max_iterations_is_never_exceeded(planner_id: str, allowed: int, scene_of: SceneOf) -> None:
    scene = scene_of("table_columns")
    task = scene.cell.tasks[0]
    work = Work(allowed, 1.0, lambda: 0.0, improvement=allowed)
    options = PlanOptions(planner_id=planner_id)
    plan = planned(np.array(task.start), np.array(task.goal), scene, options, work)
    assert plan.info.iterations <= allowed
    assert not plan.info.truncated


def test_work_for_one_thread_is_done_by_the_thread_that_asks(demo_scene: PlanningScene) -> None:
    work = Work(1000, 1.0, lambda: 0.0, threads=1)
    context = Context(demo_scene, PlanOptions(), Journal(work, 0))
    found = mapped(lambda item, mine: threading.get_ident(), range(8), context, 0, [1] * 8)
    assert set(found) == {threading.get_ident()}


def test_sbl_exceeds_its_work_nowhere(scene_of: SceneOf) -> None:
    """Samples are charged by the forty, so it depends on the count whether the last ones still
    fit.
    """
    scene = scene_of("table_columns")
    task = scene.cell.task("tL->tR")
    ends = Ends(np.array(task.start), np.array([task.goal]))
    for allowed in range(1, 60):
        space = FreeSpace.of(scene, 0.02, Work(allowed, 1.0, lambda: 0.0))
        SEARCHES["sbl"].find(ends, space, allowed)
        assert space.work.iterations <= allowed


@pytest.mark.parametrize("late", [False, True])
def test_an_asynchronous_request_whose_time_is_over_keeps_its_synchronous_answer(
    scene_of: SceneOf, late: bool
) -> None:
    """Own laws of the joints along a path with many corners take longer than its search."""
    now = [0.0]
    work = Work(100_000, 1.0, lambda: now[0])
    scene = scene_of("open")
    task = scene.cell.task("home->p1")
    context = Context(scene, PlanOptions(timing="asynchronous"), Journal(work, 0))
    asked = context.with_timing("synchronous")
    status, answer = search_regional(np.array(task.start), np.array(task.goal), asked, SEARCHES)
    assert status.ok
    assert answer is not None
    now[0] = 2.0 if late else 0.0
    found = with_own_laws(answer, context)
    notes = [stage.note for stage in context.journal.stages if stage.name == "asynchronous"]
    assert (notes == [LATE]) == late
    assert work.truncated == late
    if late:
        assert found is answer
        assert context.journal.timing == "synchronous"
