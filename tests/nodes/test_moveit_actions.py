"""Goals of MoveIt's actions and the driver's stops, on plain objects, without moveit_msgs."""

from __future__ import annotations

import threading
from types import SimpleNamespace as Of
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from hypothesis import given
from hypothesis import strategies as st
from rclpy.action import ActionClient, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future

from ir_msgs.action import ExecuteTrajectory
from ir_msgs_py.ros.rclpy_inside import PatientActionServer
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import Status, StatusCode
from ir_planner.node import moveit_actions
from ir_planner.node.moveit_actions import AcceptedGoals, MoveAction, TrajectoryExecution

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


@pytest.fixture
def execution() -> TrajectoryExecution:
    return TrajectoryExecution(lambda goal, stopped: None, lambda trajectory: None)


def test_a_goal_that_was_sent_before_a_recovery_is_canceled_whenever_it_comes(
    execution: TrajectoryExecution,
) -> None:
    execution.hear_recovery(0)
    before = execution.accept(1000)
    unknown = execution.accept()
    after = execution.accept(2000)
    execution.hear_recovery(2000)
    assert before.canceled
    assert unknown.canceled
    assert not after.canceled
    assert execution.accept(1999).canceled
    assert not execution.accept(2000).canceled
    assert not execution.accept().canceled  # not known when it was sent


def test_goals_of_an_action_server_end_as_they_were_asked_to(
    execution: TrajectoryExecution, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    """With rclpy's own handles, which have no hash, on an action of this project."""
    goals = AcceptedGoals(execution)

    def accepted(goal: Any) -> None:
        goals.add(goal)
        goal.execute()

    def cancel(goal: Any) -> CancelResponse:
        goals.cancel(goal)
        return CancelResponse.ACCEPT

    async def execute(goal: Any) -> Any:
        waits = Future()
        with goals.stopped(goal).calling(lambda: waits.set_result(None)):
            if goal.request.trajectory_id == "succeeds":
                waits.set_result(None)
            await waits
        done = goal.request.trajectory_id == "succeeds"
        goals.end(goal, StatusCode.SUCCESS if done else StatusCode.PREEMPTED)
        return ExecuteTrajectory.Result()

    server = ros_executor.run(
        lambda: PatientActionServer(
            ros_node,
            ExecuteTrajectory,
            "/drive",
            execute,
            handle_accepted_callback=accepted,
            cancel_callback=cancel,
            callback_group=ReentrantCallbackGroup(),
        )
    )
    client = ros_executor.run(lambda: ActionClient(ros_node, ExecuteTrajectory, "/drive"))
    wait_for(client.server_is_ready, what="the action is offered")
    ends = {}
    for name in ("succeeds", "stopped"):
        goal = ExecuteTrajectory.Goal(trajectory_id=name)
        sent = ros_executor.run(lambda goal=goal: client.send_goal_async(goal))
        wait_for(sent.done, what="the goal is taken")
        ends[name] = ros_executor.run(sent.result().get_result_async)
    ros_executor.run(execution.stop)
    wait_for(lambda: all(end.done() for end in ends.values()), what="the goals end")
    assert ends["succeeds"].result().status == GoalStatus.STATUS_SUCCEEDED
    assert ends["stopped"].result().status == GoalStatus.STATUS_ABORTED
    ros_executor.run(client.destroy)
    ros_executor.run(server.destroy)


def test_a_goal_whose_client_cancels_it_ends_canceled_as_soon_as_it_may(
    execution: TrajectoryExecution,
) -> None:
    """rclpy changes its state after the callback of the cancel, which has woken it."""
    goals = AcceptedGoals(execution)
    ended: list[str] = []
    goal = Of(
        goal_id=Of(uuid=bytes(16)),
        is_cancel_requested=False,
        canceled=lambda: ended.append("canceled"),
        abort=lambda: ended.append("aborted"),
    )
    goals.add(goal)
    goals.cancel(goal)
    assert goals.stopped(goal).canceled
    ending = threading.Thread(target=goals.end, args=(goal, StatusCode.PREEMPTED))
    ending.start()
    assert not ended
    goal.is_cancel_requested = True
    ending.join(PATIENCE)
    assert ended == ["canceled"]
    goals.cancel(goal)  # a cancel that comes late finds nothing


def test_a_cancel_that_rclpy_does_not_carry_out_ends_the_goal_all_the_same(
    execution: TrajectoryExecution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(moveit_actions, "_PATIENCE", 0.05)
    goals = AcceptedGoals(execution)
    ended: list[str] = []
    goal = Of(
        goal_id=Of(uuid=bytes(16)),
        is_cancel_requested=False,
        canceled=lambda: ended.append("canceled"),
        abort=lambda: ended.append("aborted"),
    )
    goals.add(goal)
    goals.cancel(goal)
    goals.end(goal, StatusCode.PREEMPTED)
    assert ended == ["aborted"]


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


def test_goals_whose_clients_have_gone_are_stopped_and_no_others(
    execution: TrajectoryExecution,
) -> None:
    goals = AcceptedGoals(execution)
    there = dict.fromkeys((b"a" * 16, b"b" * 16), True)
    handles = {name: Of(goal_id=Of(uuid=name)) for name in there}
    for name, handle in handles.items():
        goals.add(handle, lambda name=name: not there[name])
    assert goals.stop_abandoned() == 0
    there[b"a" * 16] = False
    assert goals.stop_abandoned() == 1
    assert [goals.stopped(each).canceled for each in handles.values()] == [True, False]
    assert goals.stop_abandoned() == 0
