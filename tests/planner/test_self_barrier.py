"""A joint value at which an arm always meets itself parts its configurations, and nothing else
does.
"""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import load_cell, load_power_data
from ir_planner.checks import FreeSpace
from ir_planner.regional.no_path import barrier, spreads
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.search import Ends

CELLS = ("open", "kr300_pallets", "kr6_bench", "ur10e_bench")
BEFORE = np.radians([0.0, -100.0, -80.0, -90.0, 90.0, 0.0])
BEYOND = np.radians([23.9, -70.9, 94.9, -114.1, 270.0, 23.9])  # wrist 2 beyond 180 degrees


def scene_of(name: str) -> PlanningScene:
    cell = load_cell(name)
    return scene_with(cell, load_text(cell), load_power_data())


def space_of(scene: PlanningScene, safety_distance: float) -> FreeSpace:
    return FreeSpace.of(scene, safety_distance, Work(400_000, 1.0, lambda: 0.0))


@pytest.mark.parametrize("name", CELLS)
def test_no_distance_changes_more_than_is_said_while_one_joint_stays(name: str) -> None:
    scene = scene_of(name)
    robot = scene.cell.robot
    spread = spreads(scene)
    rng = np.random.default_rng(4)
    known = np.flatnonzero(np.isfinite(spread).any(axis=1))
    assert len(known) > 0
    for joint in known:
        q = rng.uniform(robot.position_min, robot.position_max, (300, 6))
        q[:, joint] = q[0, joint]
        distances = scene.collision.distances(q)
        assert (distances.max(axis=0) - distances.min(axis=0) <= spread[joint] + 1e-9).all()


def test_an_offset_wrist_that_always_meets_itself_between_two_ends_is_a_proof() -> None:
    scene = scene_of("ur10e_bench")
    space = space_of(scene, 0.02)
    found = barrier(Ends(BEFORE, BEYOND[None]), space)
    assert found is not None
    assert found.joint == "wrist_2_joint"
    assert "wrist_2_joint would have to pass 180 deg" in found.status.message
    robot = scene.cell.robot
    rng = np.random.default_rng(5)
    q = rng.uniform(robot.position_min, robot.position_max, (1000, 6))
    q[:, 4] = found.value
    names = [{pair.body_a, pair.body_b} for pair in scene.collision.pairs]
    own = scene.collision.distances(q)[:, names.index(set(found.pair))]
    assert own.max() <= found.distance + 1e-9 < found.needed


def test_what_a_smaller_safety_distance_or_another_goal_allows_is_no_proof() -> None:
    scene = scene_of("ur10e_bench")
    near = BEFORE + 0.1
    assert barrier(Ends(BEFORE, BEYOND[None]), space_of(scene, 0.002)) is None
    assert barrier(Ends(BEFORE, np.array([BEYOND, near])), space_of(scene, 0.02)) is None
