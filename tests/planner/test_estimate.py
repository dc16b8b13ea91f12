"""A coarse solution says about what the certified answer costs."""

from collections.abc import Callable

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_planner.optimize import Refinement
from ir_planner.optimize.portfolio import estimate
from ir_planner.optimize.refinement import THOROUGH
from ir_planner.request import Context, Work
from ir_planner.scene.planning_scene import PlanningScene

FREE = ("home->p1", "p2->cab")
NEAR = 0.1  # of the certified answer: 0.05 is usual


def context_of(scene: PlanningScene) -> Context:
    work = Work(400_000, 1.0, lambda: 0.0)
    return Context.of(scene, PlanOptions(planning_time=600.0), work)


@pytest.mark.parametrize("name", FREE)
def test_it_is_near_the_certified_answer(
    scene_of: Callable[[str], PlanningScene], name: str
) -> None:
    scene = scene_of("open")
    task = scene.cell.task(name)
    refinement = Refinement(context_of(scene))
    segment = np.stack([task.start, task.goal])
    found = estimate([segment], refinement)
    answer = refinement.refined(refinement.coarse(segment, THOROUGH.coarse), segment, THOROUGH)
    assert answer is not None
    assert answer.prove().certified
    assert found.cost == pytest.approx(answer.cost, rel=NEAR)


def test_a_dearer_path_beside_it_changes_nothing(scene_of: Callable[[str], PlanningScene]) -> None:
    scene = scene_of("open")
    task = scene.cell.task("home->p1")
    context = context_of(scene)
    segment = np.stack([task.start, task.goal])
    detour = np.stack(
        [task.start, task.start + np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.0]), task.goal]
    )
    alone = estimate([segment, segment], Refinement(context))
    beside = estimate([detour, segment], Refinement(context))
    assert beside.cost == alone.cost
    assert beside.spline.control.tobytes() == alone.spline.control.tobytes()
