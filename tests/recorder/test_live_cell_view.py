"""What the live view makes of what it heard: the scene, places of parts, doors, the nearest pair,
paths.
"""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ir_description import Cell, cell_to_yaml, load_cell
from ir_description.cell import cell_in
from ir_kernels import Chain
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.analysis.clearance import collision_model
from ir_recorder.live.cell_view import PATH_POINTS, CellView, ReceivedCell
from ir_recorder.live.stream import states_of

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell("demo")


@pytest.fixture
def heard(cell: Cell) -> ReceivedCell:
    return ReceivedCell(cell_to_yaml(cell), joints=cell.robot.joint_names, q=HOME, load="gripper")


def test_the_nearest_pair_is_that_of_the_cell_as_it_stands(cell: Cell, heard: ReceivedCell) -> None:
    view = CellView()
    for load in ("gripper", "none", "gripper+gear"):
        near: Any = view.look(replace(heard, load=load))["near"]
        distance, *points, pair = near
        exact = collision_model(cell, load, cell.parts_at_start()).min_distance(HOME[None])
        assert distance == pytest.approx(exact.distance[0], abs=1e-5)
        assert np.linalg.norm(np.subtract(points[:3], points[3:])) == pytest.approx(
            distance, abs=1e-3
        )
        assert " – " in str(pair)


def test_in_a_pause_no_pair_is_the_nearest_as_in_a_report(heard: ReceivedCell) -> None:
    view = CellView()
    for kind, said in (("pause", False), ("regional", True)):
        near = view.look(replace(heard, movement=PlannedMovement(kind=kind)))["near"]
        assert (near is not None) is said
    with_part = PlannedMovement(kind="regional", load="gripper+gear")
    late = view.look(replace(heard, movement=with_part))["near"]
    assert late == view.look(replace(heard, movement=with_part, load="gripper+gear"))["near"]


def test_joints_in_another_order_are_put_right_and_strangers_show_nothing(
    heard: ReceivedCell,
) -> None:
    view = CellView()
    q = np.radians([10.0, -80.0, 85.0, 5.0, 30.0, -20.0])
    expected = view.look(replace(heard, q=q))["near"]
    assert view.look(replace(heard, joints=heard.joints[::-1], q=q[::-1]))["near"] == expected
    for joints, values in (
        (("a", "b"), np.zeros(2)),
        (heard.joints, np.zeros(7)),
        (heard.joints, np.full(6, np.nan)),
        ((), np.zeros(0)),
    ):
        assert view.look(replace(heard, joints=joints, q=values))["near"] is None


def test_a_door_that_moves_is_another_scene_and_an_unknown_state_is_none(
    heard: ReceivedCell,
) -> None:
    view = CellView()
    number = view.look(heard)["scene"]
    assert json.loads(view.scene)["frames"] == 0
    assert view.look(replace(heard, states=(("lathe", "door_closed"),)))["scene"] != number
    assert (
        view.look(replace(heard, states=(("lathe", "door_open"), ("infeed", ""))))["scene"]
        == number
    )
    strange = (("lathe", "molten>door_open"), ("gauge", "a>b>c"), ("nobody", "door_open"))
    assert view.look(replace(heard, states=strange))["scene"] == number


def test_a_machine_that_changes_is_heard_as_recordings_have_it() -> None:
    message = SimpleNamespace(
        equipment=["lathe", "gauge", "x"], states=["shut", "up", "a"], next=["open", ""]
    )
    assert states_of(message) == (("lathe", "shut>open"), ("gauge", "up"))


def test_a_door_that_opens_is_drawn_and_measured_as_what_it_sweeps(
    cell: Cell, heard: ReceivedCell
) -> None:
    def drawn(text: str) -> tuple[set[str], set[str], list[Any]]:
        near: Any = view.look(replace(heard, states=(("lathe", text),)))["near"]
        bodies = json.loads(view.scene)["bodies"]
        assert all(body["shown"][-1][1] for body in bodies)
        return {b["name"] for b in bodies}, {b["name"] for b in bodies if b["sweep"]}, near

    view = CellView()
    before, none, _ = drawn("door_open")
    moving, swept, near = drawn("door_open>door_closed")
    after, no_more, _ = drawn("door_closed")
    assert none == no_more == set()
    assert swept
    assert moving == before | after | swept
    now = cell_in(cell, {"lathe": ("door_open", "door_closed")})
    exact = collision_model(now, "gripper", cell.parts_at_start()).min_distance(HOME[None])
    assert near[0] == pytest.approx(exact.distance[0], abs=1e-5)
    assert drawn("door_open")[0] == before  # and the states of the cell stay those of its file


def test_parts_lie_where_the_steps_of_the_program_put_them(heard: ReceivedCell) -> None:
    view = CellView()
    start = view.look(heard)["lies"]
    assert set(start) == {"gear"}  # type: ignore[arg-type]
    taken = PlannedMovement(kind="service_entry", to_station="infeed_pick", attach="gear")
    put = PlannedMovement(kind="service_entry", to_station="outfeed_place", detach="gear")
    assert view.look(replace(heard, ended=(taken,)))["lies"] == {}
    assert view.look(replace(heard, ended=(put,)))["lies"] != start
    assert view.look(replace(heard, ended=(None,)))["lies"] == start


def test_a_planned_path_is_where_the_tool_goes(cell: Cell, heard: ReceivedCell) -> None:
    goal = np.radians([30.0, -70.0, 80.0, 0.0, 20.0, 0.0])
    path = JointTrajectory.from_seconds(cell.robot.joint_names, [0.0, 2.0], [HOME, goal])
    packed = CellView().look(replace(heard, path=path))["path"]
    points = np.frombuffer(base64.b64decode(str(packed)), "<f4").reshape(PATH_POINTS, 3)
    ends = Chain(cell.robot, cell.base_pose, cell.tcp).tcp_poses(np.array([HOME, goal]))[:, :3, 3]
    assert points[[0, -1]] == pytest.approx(ends, abs=1e-5)
    other = JointTrajectory.from_seconds(("a",), [0.0, 1.0], [[0.0], [1.0]])
    assert CellView().look(replace(heard, path=other))["path"] == ""


def test_a_cell_that_cannot_be_read_is_a_sentence_until_the_next_one(heard: ReceivedCell) -> None:
    view = CellView()
    assert view.look(ReceivedCell())["scene"] == ""
    broken = view.look(replace(heard, cell="format: ir_cell/1\nname: '<script>'\n"))
    assert "can't be read" in str(broken["problem"])
    assert view.scene == b""
    assert view.look(heard)["problem"] == ""
    assert view.scene != b""
