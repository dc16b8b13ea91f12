"""Goals of MoveIt's actions and the driver's stops, on plain objects, without moveit_msgs."""

from __future__ import annotations

from types import SimpleNamespace as Of
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs_py.status import Status, StatusCode
from ir_planner.node import moveit_actions
from ir_planner.node.moveit_actions import MoveAction, TrajectoryExecution

TRAJECTORY = Of(
    multi_dof_joint_trajectory=Of(points=()), joint_trajectory=Of(points=("a", "b"), joint_names=())
)
ASKED = Of(
    planning_options=Of(
        plan_only=False,
        replan=False,
        look_around=False,
        planning_scene_diff=Of(
            name="",
            robot_state=Of(joint_state=Of(name=()), attached_collision_objects=()),
            allowed_collision_matrix=Of(entry_names=()),
            world=Of(collision_objects=(), octomap=Of(octomap=Of(data=()))),
            link_padding=(),
            link_scale=(),
        ),
    ),
    request=Of(start_state=Of()),
)


@pytest.fixture(autouse=True)
def plain_goals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moveit_actions, "follow_goal", lambda: Of)


@given(
    st.lists(
        st.sampled_from(("press", "recover", "accept", "plan and drive", "drive")), max_size=20
    )
)
def test_no_goal_that_was_accepted_before_a_stop_or_its_recovery_is_driven(events: Any) -> None:
    """The judge notes for each goal which presses and recoveries its sender had seen."""
    number = 0
    latched = 0
    history = 0  # presses and recoveries so far
    driven: list[int] = []
    waiting: list[tuple[int, Any]] = []

    def send(goal: Any, stopped: Any) -> Any:
        assert not stopped.canceled
        driven.append(history)
        return Of(error_code=0, error_string="")

    executor = TrajectoryExecution(send, lambda trajectory: None)
    move = MoveAction(
        lambda request, response, stopped: Status.success(),
        lambda: (
            Of(),
            Of(
                motion_plan_response=Of(
                    trajectory=TRAJECTORY, trajectory_start=None, planning_time=0.0
                )
            ),
        ),
        lambda state: None,
        executor,
    )
    executor.hear("number", number)
    executor.hear("latched", latched)
    for event in events:
        if event in ("press", "recover"):
            history += event == "press" or latched
            number += event == "press"
            latched = int(event == "press")
            executor.hear("number", number)
            executor.hear("latched", latched)
        elif event == "accept":
            waiting.append((history, executor.accept()))
        elif waiting:
            accepted, stopped = waiting.pop(0)
            before = len(driven)
            status = (
                executor.drive(TRAJECTORY, stopped)
                if event == "drive"
                else move.run(ASKED, Of(), stopped, lambda state: None)
            )
            assert (len(driven) > before) == status.ok == (accepted == history)
            assert status.ok or status.code == StatusCode.PREEMPTED


def test_a_stop_while_it_is_driven_ends_it_with_the_words_of_the_controller() -> None:
    def send(goal: Any, stopped: Any) -> Any:
        executor.hear("number", 1)
        assert stopped.canceled
        return Of(error_code=-1, error_string="emergency stop")

    executor = TrajectoryExecution(send, lambda trajectory: None)
    executor.hear("number", 0)
    status = executor.drive(TRAJECTORY, executor.accept())
    assert status.code == StatusCode.PREEMPTED
    assert status.message == "stopped along the path: emergency stop"
