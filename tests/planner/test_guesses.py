"""Guesses are the same for every seed, and the answer that they lead to is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from asking import planned
from hypothesis import given
from hypothesis import strategies as st

from ir_kernels.collision import FREE
from ir_msgs_py.options import PlanOptions
from ir_planner.checks import FreeSpace
from ir_planner.curves import along_path
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.search import guesses, straight_along

SceneOf = Callable[[str], PlanningScene]
HIGH = np.radians([185.0, -5.0, 168.0, 350.0, 125.0, 350.0])
LOW = np.radians([-185.0, -140.0, -120.0, -350.0, -125.0, -350.0])
SPREAD = 0.05  # of J over the seeds
configurations = st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6).map(
    lambda share: LOW + np.array(share) * (HIGH - LOW)
)


@given(configurations, configurations, configurations)
def test_guesses_lead_from_start_to_goal_within_the_limits(
    start: np.ndarray, goal: np.ndarray, park: np.ndarray
) -> None:
    paths = guesses(start, goal, park, LOW, HIGH)
    for path in paths:
        np.testing.assert_array_equal(path[0], start)
        np.testing.assert_array_equal(path[-1], goal)
        assert ((path >= LOW) & (path <= HIGH)).all()
    again = guesses(start, goal, park, LOW, HIGH)
    assert all(np.array_equal(a, b) for a, b in zip(paths, again, strict=True))


def test_joints_beyond_the_fifth_stay_where_the_straight_segment_has_them() -> None:
    start = np.zeros(6)
    goal = np.full(6, 0.4)
    for path in guesses(start, goal, np.zeros(6), LOW - 9.0, HIGH + 9.0)[4:]:
        assert set(np.round(path[1:-1, 5], 9)) <= {0.1, 0.2, 0.3}


@pytest.mark.long
@pytest.mark.parametrize(
    "cell", ["table_columns", pytest.param("deep_box", marks=pytest.mark.long)]
)
def test_the_seed_makes_little_difference(cell: str, scene_of: SceneOf) -> None:
    scene = scene_of(cell)
    for task in scene.cell.tasks[:3]:
        costs = []
        for seed in (1, 2, 3):
            work = Work(400_000, 1.0, lambda: 0.0)
            plan = planned(
                np.array(task.start), np.array(task.goal), scene, PlanOptions(seed=seed), work
            )
            assert plan.status.ok, plan.status.message
            costs.append(
                plan.report.energy - plan.report.base_energy + 500.0 * plan.report.duration
            )
        assert max(costs) <= (1.0 + SPREAD) * min(costs), task.name


@pytest.mark.long
def test_straight_steps_along_a_free_curve_are_free(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    work = Work(400_000, 1.0, lambda: 0.0)
    space = FreeSpace.of(scene, 0.01, work)
    followed = 0
    for task in scene.cell.tasks:
        paths = guesses(
            np.array(task.start), np.array(task.goal), scene.cell.park, space.low, space.high
        )
        for path in paths:
            points = along_path(path, 40, 1.0).samples(6)[0]
            free = space.certificates(points[:-1], points[1:]).verdict == FREE
            steps = straight_along(points, space, scene.weights)
            if free.all():
                assert steps is not None
            if steps is None:
                continue
            followed += len(steps) > 2
            assert (space.certificates(steps[:-1], steps[1:]).verdict == FREE).all()
            np.testing.assert_array_equal(steps[[0, -1]], points[[0, -1]])
    assert followed > 0  # at least one of them had to bend
