"""A joint value at which an arm always meets itself, or a wall, parts its configurations, and
nothing else does.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ir_description import Body, load_cell, load_power_data
from ir_description.cell import Equipment, Zone
from ir_description.poses import pose_of, rotation_from_abc
from ir_planner import Planner
from ir_planner.checks import FreeSpace
from ir_planner.regional.no_path import barrier, spreads
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.search import Ends
from ir_values.arrays import FloatArray

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of distances
from _coal_model import Coal

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


def behind_walls(seed: int) -> tuple[Planner, FloatArray, FloatArray]:
    """A cell with two walls that lead outwards from somewhere beside the foot, one opposite the
    other, and configurations on both sides.
    """
    draw = np.random.default_rng([seed, 41])
    begin = draw.uniform(0.45, 0.8)
    height = draw.uniform(1.5, 4.5)
    turned = draw.uniform(-0.4, 0.4)
    bodies = []
    for k, angle in enumerate((turned, turned + np.pi)):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        middle = 0.5 * (begin + 4.5) * out + np.array([0.0, 0.0, 0.5 * height])
        pose = pose_of(middle, rotation_from_abc([np.degrees(angle), 0.0, 0.0]))
        bodies.append(Body(f"wall_{k}", "box", pose, np.array([4.5 - begin, 0.1, height])))
    bare = replace(load_cell("open"), stations=(), tasks=(), parts=(), program=())
    zone = Zone("OPEN", np.eye(4), np.full(3, 0.1))
    machine = Equipment("walls", np.eye(4), tuple(bodies), zone)
    planner = Planner(replace(bare, equipment=(machine,)), clock=lambda: 0.0)
    upright = np.array([0.0, -0.5 * np.pi, 0.5 * np.pi, 0.0, 0.0, 0.0])
    aside = np.eye(6)[0] * 1.2
    return planner, upright - np.eye(6)[0] * turned - aside, upright - np.eye(6)[0] * turned + aside


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 40), marks=pytest.mark.long)])
def test_a_wall_that_the_first_link_never_passes_is_a_proof(seeds: range) -> None:
    """Judged by Coal, at the value that no path is said to pass, with other joints of any value."""
    proved = 0
    for seed in seeds:
        planner, start, goal = behind_walls(seed)
        if not planner.check_states(np.stack([start, goal])).valid.all():
            continue
        scene = planner.scene()
        found = barrier(Ends(start, goal[None]), space_of(scene, 0.02))
        if found is None:
            continue
        plan = planner.plan_regional(start=start, goal=goal, max_iterations=20_000)
        assert not plan.status.ok
        assert "no path exists" in plan.status.message
        robot = scene.cell.robot
        loads = [capsule for load in scene.loads for capsule in load.capsules]
        judge = Coal(scene.collision, [*robot.capsules, *loads], scene.cell.bodies())
        names = [{pair.body_a, pair.body_b} for pair in scene.collision.pairs]
        q = np.random.default_rng(seed).uniform(robot.position_min, robot.position_max, (50, 6))
        q[:, 0] = found.value
        for one in q:
            assert judge.distances(one)[names.index(set(found.pair))] < found.needed
        assert min(start[0], goal[0]) < found.value < max(start[0], goal[0])
        proved += 1
    assert proved > 0
