"""An end that is walled in is recognised without a search; nothing that a path leads to is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from asking import planned
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import Body, Cell, Equipment, cell_from_yaml, load_power_data
from ir_description.cell import Zone
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.regional.no_path import distance_at_most, enclosure
from ir_planner.request.context import Work
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.search import Ends

SceneOf = Callable[[str], PlanningScene]
S_M = 0.02
HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
PARK = np.radians([0.0, -125.0, 120.0, 0.0, 80.0, 0.0])
WALL = 0.05  # m
SIDES = [(axis, side) for axis in range(3) for side in (-1.0, 1.0)]


def work() -> Work:
    return Work(400_000, 1.0, lambda: 0.0)


def walls(
    pose: np.ndarray, size: np.ndarray, missing: tuple[int, float] | None = None
) -> Equipment:
    """A room: six walls around a box of inner `size` (3,) at a pose (4, 4), one of them left
    out.
    """
    bodies = []
    for axis, side in SIDES:
        if (axis, side) == missing:
            continue
        own = np.eye(4)
        own[axis, 3] = side * 0.5 * (size[axis] + WALL)
        edges = size + 2.0 * WALL
        edges[axis] = WALL
        bodies.append(Body(f"wall_{'xyz'[axis]}{'-' if side < 0 else ''}", "box", own, edges))
    return Equipment("room", pose, tuple(bodies), Zone("CLOSED", np.eye(4), size + 2.0 * WALL))


def bare(cell: Cell, room: Equipment) -> PlanningScene:
    """The cell with a room in place of its machines."""
    alone = replace(cell, equipment=(room,), stations=(), program=(), signals=(), tasks=())
    return scene_with(alone, load_text(alone), load_power_data())


def around_tool(scene: PlanningScene, q: np.ndarray, shift: np.ndarray, turn: float) -> np.ndarray:
    """Pose (4, 4) of a room about the middle of the tool at q, moved and turned about the vertical
    axis.
    """
    link = scene.chain.link_poses(q[None])[0, -1]
    points = [link[:3, :3] @ p + link[:3, 3] for c in scene.loads[0].capsules for p in (c.p0, c.p1)]
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    pose[:3, 3] = 0.5 * (np.min(points, axis=0) + np.max(points, axis=0)) + shift
    return pose


@settings(max_examples=2)
@given(
    st.floats(-0.1, 0.1),
    st.floats(-0.1, 0.1),
    st.floats(-0.1, 0.1),
    st.floats(-3.1, 3.1),
    st.booleans(),
)
def test_an_end_in_a_closed_room_is_recognised(
    scene_of: SceneOf, x: float, y: float, z: float, turn: float, at_start: bool
) -> None:
    # the load stands in a room of its own: as if the flange reached through a wall that the load
    # can't pass
    scene = scene_of("open")
    pose = around_tool(scene, HOME, np.array([x, y, z]), turn)
    closed = bare(scene.cell, walls(pose, np.array([1.2, 1.2, 1.2])))
    space = FreeSpace.of(closed, S_M, work())
    start, goal = (HOME, PARK) if at_start else (PARK, HOME)
    found = enclosure(Ends(start, goal[None]), space)
    assert found is not None
    assert found.end == ("start" if at_start else "goal")
    assert found.body.startswith("wall_")
    assert found.clearance < S_M
    assert found.needed == pytest.approx(S_M, abs=1e-5)


@pytest.mark.sampled
@pytest.mark.parametrize("missing", SIDES)
def test_a_room_without_a_wall_encloses_nothing(
    scene_of: SceneOf, missing: tuple[int, float]
) -> None:
    scene = scene_of("open")
    pose = around_tool(scene, HOME, np.zeros(3), 0.3)
    room = bare(scene.cell, walls(pose, np.array([1.2, 1.2, 1.2]), missing))
    assert enclosure(Ends(PARK, HOME[None]), FreeSpace.of(room, S_M, work())) is None


@pytest.mark.parametrize(
    ("cell", "every"),
    [
        ("cnc_door", 4),
        ("deep_box", 4),
        *(
            pytest.param(cell, 1, marks=pytest.mark.long)
            for cell in ("open", "table_columns", "cnc_door", "deep_box")
        ),
    ],
)
def test_no_end_of_a_task_is_called_enclosed(cell: str, every: int, scene_of: SceneOf) -> None:
    scene = scene_of(cell)
    space = FreeSpace.of(scene, 0.005, work())
    goals = np.array([task.goal for task in scene.cell.tasks])
    assert enclosure(Ends(HOME, goals[:1]), space) is None
    for task in scene.cell.tasks[::every]:
        assert enclosure(Ends(np.array(task.start), np.array([task.goal])), space) is None


BALL = """
format: ir_cell/1
name: ball
description: A robot that carries a ball.
robot: kr210_r2700_extra
floor: true
home_deg: [0, -90, 90, 0, 0, 0]
park_deg: [0, -125, 120, 0, 80, 0]
tool:
  name: ball
  mass: 50
  com: [0.5, 0, 0]
  inertia: [1, 1, 1, 0, 0, 0]
  capsules:
    - {name: load, p0: [0.6, 0, 0], p1: [0.6, 0, 0], radius: 0.4}
tcp: {xyz: [0.6, 0, 0]}
"""


@pytest.mark.long
@pytest.mark.parametrize("half", [0.34, 0.6])
def test_a_slot_for_the_arm_lets_a_thicker_load_out_or_not(half: float) -> None:
    cell = cell_from_yaml(BALL)
    scene = scene_with(cell, load_text(cell), load_power_data())
    room = walls(around_tool(scene, HOME, np.zeros(3), 0.0), np.array([1.3, 1.3, 1.3]), (0, -1.0))
    plates = []
    for side in (-1.0, 1.0):
        pose = np.eye(4)
        pose[:3, 3] = -0.5 * (1.3 + WALL), 0.0, side * (half + 0.5)
        plates.append(Body(f"plate{side:+.0f}", "box", pose, np.array([WALL, 1.4, 1.0])))
    room = replace(room, bodies=(*room.bodies, *plates))
    closed = bare(cell, room)
    assert FreeSpace.of(closed, S_M, work()).states_free(np.stack([HOME, PARK])).all()
    plan = planned(HOME, PARK, closed, PlanOptions(planning_time=600.0), work())
    if half > 0.5:
        assert plan.status.ok, plan.status.message
        return
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert "the start is enclosed: load can't get out past" in plan.status.message
    assert plan.info.stages[-1].name == "enclosure"
    assert plan.info.iterations < 20_000
    best = float(plan.status.message.split("come to ")[1].split(" mm")[0])
    assert 1e3 * (half - 0.4) - 60.0 < best < 20.0  # the grid's cubes are 50 mm wide


@given(
    st.sampled_from(["box", "cylinder", "sphere", "capsule", "plane", "mesh"]),
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
    st.lists(st.floats(0.05, 1.0), min_size=3, max_size=3),
)
def test_lengths_are_at_least_the_distance(
    kind: str, point: list[float], size: list[float]
) -> None:
    used = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "plane": 0, "mesh": 0}[kind]
    corners = np.array(np.meshgrid([-0.3, 0.4], [-0.2, 0.5], [-0.1, 0.2])).reshape(3, -1).T
    vertices = corners if kind == "mesh" else np.zeros((0, 3))
    pose = np.eye(4)
    pose[:3, :3] = np.linalg.qr(np.array([[1.0, 2.0, 0.3], [0.0, 1.0, 0.5], [0.4, 0.1, 1.0]]))[0]
    body = Body("body", kind, pose, np.where(np.arange(3) < used, size, 0.0), vertices)
    there = np.array(point)
    found = float(distance_at_most(body, there))
    # every point of the body that random directions lead to is no nearer than the least of them
    inside = _points_of(body)
    nearest = float(np.linalg.norm(inside - there, axis=1).min())
    assert found <= nearest + 1e-9 or kind == "mesh"
    if kind != "mesh":
        assert found >= nearest - 0.25
    else:
        assert found >= float(np.linalg.norm(corners @ pose[:3, :3].T - there, axis=1).min()) - 1e-9


def _points_of(body: Body) -> np.ndarray:
    """Points within a body, densely."""
    rng = np.random.default_rng(1)
    local = (
        rng.uniform(-2.5, 2.5, (200_000, 3))
        if body.kind == "plane"
        else rng.uniform(-1.6, 1.6, (60_000, 3))
    )
    x, y, z = local.T
    radius, length, _ = body.size
    if body.kind == "plane":
        kept = z <= 0.0
    elif body.kind == "box":
        kept = (np.abs(local) <= 0.5 * body.size).all(axis=1)
    elif body.kind == "cylinder":
        kept = (np.hypot(x, y) <= radius) & (np.abs(z) <= 0.5 * length)
    else:
        above = np.maximum(np.abs(z) - 0.5 * length, 0.0) if body.kind == "capsule" else z
        kept = x * x + y * y + above * above <= radius * radius
    centre = np.zeros((1, 3))
    return np.concatenate([centre, local[kept]]) @ body.pose[:3, :3].T
