"""Regional movements: straight where it is free, round where it is not, a sentence where nothing is
found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from asking import planned

from ir_description import cell_from_yaml, load_cell, load_power_data
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.errors import CancelledError
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PROOF_TOLERANCE, PlanningScene, load_text, scene_with
from ir_planner.search import SEARCHES, Ends, Found

SceneOf = Callable[[str], PlanningScene]
TASKS = [
    (cell, task.name, flip)
    for cell in ("open", "table_columns")
    for task in load_cell(cell).tasks
    for flip in (False, True)
]


def clearance_along(trajectory: Any, scene: PlanningScene, step: float = 5e-4) -> float:
    return float(
        scene.collision.distances(
            trajectory.sample(np.arange(0.0, trajectory.duration, step)).q
        ).min()
    )


@pytest.mark.sampled
@pytest.mark.parametrize(("cell", "task", "flip"), TASKS)
def test_every_task_of_the_open_cells_is_solved_and_certified(
    cell: str, task: str, flip: bool, scene_of: SceneOf, budget: Work, options: PlanOptions
) -> None:
    scene = scene_of(cell)
    asked = scene.cell.task(task)
    start, goal = (asked.goal, asked.start) if flip else (asked.start, asked.goal)
    plan = planned(np.array(start), np.array(goal), scene, options, budget)
    assert plan.status.ok, plan.status.message
    assert plan.trajectory is not None
    assert plan.report.certified
    assert np.array_equal(plan.trajectory.positions[[0, -1]], np.stack([start, goal]))
    sampled = clearance_along(plan.trajectory, scene)
    assert sampled > 0.02 - PROOF_TOLERANCE
    assert plan.report.min_clearance == pytest.approx(sampled, abs=1e-4)
    assert plan.report.energy > plan.report.base_energy


@pytest.mark.parametrize(("cell", "task"), [("cnc_door", "cnc->pal"), ("deep_box", "bin->pal")])
def test_trees_find_the_path_out_where_detours_do_not(
    cell: str, task: str, scene_of: SceneOf, budget: Work, options: PlanOptions
) -> None:
    scene = scene_of(cell)
    asked = scene.cell.task(task)
    tree = replace(options, planner_id="tree")
    plan = planned(np.array(asked.start), np.array(asked.goal), scene, tree, budget)
    assert plan.status.ok, plan.status.message
    assert plan.report.certified
    assert plan.info.planner_id == "tree"
    assert plan.trajectory is not None
    assert clearance_along(plan.trajectory, scene) > 0.02 - PROOF_TOLERANCE


def test_a_tunnel_is_left_along_the_axis_of_the_tool(
    scene_of: SceneOf, budget: Work, options: PlanOptions
) -> None:
    scene = scene_of("deep_box")
    asked = scene.cell.task("tun->bin")
    drawn = replace(options, planner_id="retract")
    plan = planned(np.array(asked.start), np.array(asked.goal), scene, drawn, budget)
    assert plan.status.ok, plan.status.message
    assert plan.info.planner_id == "retract"
    assert plan.report.certified
    assert plan.trajectory is not None
    assert clearance_along(plan.trajectory, scene) > 0.02 - PROOF_TOLERANCE


def test_the_same_request_gives_the_same_bytes_and_the_seed_is_echoed(
    scene_of: SceneOf, options: PlanOptions
) -> None:
    scene = scene_of("open")
    task = scene.cell.task("p1->p2")

    def plan(seed: int) -> Any:
        budget = Work(60_000, 1.0, lambda: 0.0)
        fresh = scene_with(scene.cell, scene.load_text, scene.power)
        return planned(
            np.array(task.start), np.array(task.goal), fresh, replace(options, seed=seed), budget
        )

    first = plan(5)
    second = plan(5)
    other = plan(6)
    assert first.trajectory.trajectory_id == second.trajectory.trajectory_id
    assert first.report.energy == second.report.energy
    assert (first.info.seed, other.info.seed) == (5, 6)


@pytest.mark.parametrize(
    ("which", "code"),
    [("start", StatusCode.START_STATE_IN_COLLISION), ("goal", StatusCode.GOAL_IN_COLLISION)],
)
def test_an_end_in_collision_is_named_with_pair_and_depth(
    which: str,
    code: StatusCode,
    demo_scene: PlanningScene,
    degrees: Any,
    budget: Work,
    options: PlanOptions,
) -> None:
    home = np.array(demo_scene.cell.machine_home)
    inside = degrees(0, -20, 60, 0, 0, 0)
    start, goal = (inside, home) if which == "start" else (home, inside)
    plan = planned(start, goal, demo_scene, options, budget)
    assert plan.status.code == code
    assert which in plan.status.message
    assert "penetration: distance -" in plan.status.message
    assert plan.trajectory is None


CAGE = """
format: ir_cell/1
name: cage
description: Two walls that no path leads around.
robot: kr210_r2700_extra
floor: true
home_deg: [0, -90, 90, 0, 0, 0]
park_deg: [0, -125, 120, 0, 80, 0]
equipment:
  - name: walls
    pose: {xyz: [0, 0, 0]}
    zone: OPEN
    bodies:
      - {name: left, kind: box, size: [8, 0.2, 8], xyz: [0, 0.65, 2]}
      - {name: right, kind: box, size: [8, 0.2, 8], xyz: [0, -0.65, 2]}
"""


def test_a_search_that_misses_a_free_straight_movement_is_named(
    scene_of: SceneOf, budget: Work
) -> None:
    class Blind:
        """Finds nothing."""

        def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
            return Found([], "looked away")

    scene = scene_of("open")
    task = scene.cell.task("home->p1")
    options = PlanOptions(planner_id="blind")
    searches = {**SEARCHES, "blind": Blind()}
    plan = planned(np.array(task.start), np.array(task.goal), scene, options, budget, searches)
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert plan.status.message == (
        "no path found, though the straight movement is free: tried: blind (nothing free, looked "
        "away)"
    )


def test_where_no_path_leads_the_pair_the_place_and_what_was_tried_are_named(
    degrees: Any, options: PlanOptions
) -> None:
    cell = cell_from_yaml(CAGE)
    scene = scene_with(cell, load_text(cell), load_power_data())
    budget = Work(2000, 1.0, lambda: 0.0)
    home = degrees(0, -90, 90, 0, 0, 0)
    across = degrees(180, -90, 90, 0, 0, 0)
    plan = planned(home, across, scene, options, budget)
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert "tree (nothing free, the trees came within" in plan.status.message
    assert any(name in plan.status.message for name in ("left", "right"))
    assert plan.info.iterations >= 2000
    assert not plan.info.truncated


def test_a_blocked_path_says_what_was_tried(
    demo_scene: PlanningScene, options: PlanOptions
) -> None:
    cell = load_cell("open")
    scene = scene_with(cell, load_text(cell), demo_scene.power)
    task = cell.task("p1->p2")
    budget = Work(60_000, 1.0, lambda: 0.0)
    plan = planned(
        np.array(task.start),
        np.array(task.goal),
        scene,
        replace(options, planner_id="direct"),
        budget,
    )
    assert plan.status.code == StatusCode.PLANNING_FAILED
    for word in ("come to", "% of it", "they must keep", "tried: direct", "may help"):
        assert word in plan.status.message


def test_planning_time_cuts_a_search_and_says_truncated(
    scene_of: SceneOf, options: PlanOptions
) -> None:
    scene = scene_of("open")
    task = scene.cell.task("p1->p2")
    clock = iter(range(10_000))
    budget = Work(60_000, 0.5, lambda: float(next(clock)))
    plan = planned(
        np.array(task.start),
        np.array(task.goal),
        scene,
        replace(options, planner_id="tree"),
        budget,
    )
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert "within planning_time" in plan.status.message
    assert plan.info.truncated


def test_a_cancelled_search_stops(scene_of: SceneOf, options: PlanOptions) -> None:
    scene = scene_of("open")
    task = scene.cell.task("p1->p2")
    asked = iter([False] * 3 + [True] * 10_000)
    budget = Work(60_000, 1.0, lambda: 0.0, lambda: next(asked))
    with pytest.raises(CancelledError):
        planned(np.array(task.start), np.array(task.goal), scene, options, budget)


def test_a_safety_distance_of_zero_is_taken_literally(
    scene_of: SceneOf, options: PlanOptions, budget: Work
) -> None:
    scene = scene_of("table_columns")
    task = scene.cell.task("tL->tR")
    plan = planned(
        np.array(task.start),
        np.array(task.goal),
        scene,
        replace(options, safety_distance=0.0),
        budget,
    )
    assert plan.status.ok
    assert plan.report.certified
    assert plan.report.min_clearance > -PROOF_TOLERANCE


def test_what_is_free_at_once_is_found_without_any_work(
    scene_of: SceneOf, options: PlanOptions
) -> None:
    """A program's last movements may have no work left: a free straight one needs none."""
    scene = scene_of("open")
    home = np.array(scene.cell.machine_home)
    budget = Work(0, 1.0, lambda: 0.0)
    plan = planned(home, home + np.array([0.2, 0.0, 0.0, 0.1, 0.0, 0.0]), scene, options, budget)
    assert plan.status.ok, plan.status.message
    assert plan.report.certified
