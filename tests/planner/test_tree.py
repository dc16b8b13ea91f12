"""The trees are charged to the budget and can be stopped: exactly, and soon."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from ir_kernels.collision import FREE
from ir_planner.checks.free_space import FreeSpace
from ir_planner.errors import CancelledError
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.search.tree import connect

SceneOf = Callable[[str], PlanningScene]
TASK = "tun->bin"  # of deep_box: some hundred edges at the least
SEED = 3


def asked(scene: PlanningScene) -> tuple[np.ndarray, np.ndarray]:
    task = scene.cell.task(TASK)
    return np.array(task.start), np.array([task.goal])


def space_of(scene: PlanningScene, budget: Work) -> FreeSpace:
    return FreeSpace.of(scene, 0.02, budget)


def endless(most: int, cancelled: Callable[[], bool] = lambda: False) -> Work:
    return Work(most, 1.0, lambda: 0.0, cancelled)


def test_a_path_is_free_and_what_it_cost_is_charged(scene_of: SceneOf) -> None:
    scene = scene_of("deep_box")
    budget = endless(100_000)
    space = space_of(scene, budget)
    path = connect(*asked(scene), space, SEED).path
    assert path is not None
    assert 0 < budget.iterations < 100_000
    assert (space.certificates(path[:-1].copy(), path[1:].copy()).verdict == FREE).all()


@pytest.mark.parametrize("most", [1, 100, 300])
def test_a_budget_is_spent_to_the_last_edge_and_not_beyond(scene_of: SceneOf, most: int) -> None:
    scene = scene_of("deep_box")
    budget = endless(most)
    assert connect(*asked(scene), space_of(scene, budget), SEED).path is None
    assert budget.iterations == most
    assert not budget.truncated


def test_a_request_is_heard_between_slices(scene_of: SceneOf) -> None:
    scene = scene_of("deep_box")
    answers: Iterator[bool] = iter([False, True])
    budget = endless(100_000, lambda: next(answers))
    with pytest.raises(CancelledError):
        connect(*asked(scene), space_of(scene, budget), SEED)
    assert budget.iterations <= 2 * 256


def test_a_deadline_is_heard_between_slices(scene_of: SceneOf) -> None:
    scene = scene_of("deep_box")
    ticks = iter(range(10))
    budget = Work(100_000, 2.0, lambda: float(next(ticks)))
    assert connect(*asked(scene), space_of(scene, budget), SEED).path is None
    assert budget.truncated
    assert budget.iterations == 2 * 256


def test_heavy_joints_count_more_and_none_counts_nothing(scene_of: SceneOf) -> None:
    scale = space_of(scene_of("open"), endless(1)).scale
    assert scale[0] == 1.0
    assert (np.diff(scale) <= 0.0).all()
    assert (scale >= 0.1).all()
