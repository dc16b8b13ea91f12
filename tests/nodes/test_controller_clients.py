"""A client of control_msgs and tf2_msgs beside the driver; skipped where they are not installed."""

from __future__ import annotations

from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ir_msgs_py import names
from ir_sim_driver.motion import ErrorCode
from ir_sim_driver.node import SimDriver

control_actions = pytest.importorskip("control_msgs.action", reason="control_msgs is missing")
control_messages = pytest.importorskip("control_msgs.msg", reason="control_msgs is missing")
control_services = pytest.importorskip("control_msgs.srv", reason="control_msgs is missing")
Follow = control_actions.FollowJointTrajectory
START = (0.0, -1.5707963267948966, 1.5707963267948966, 0.0, 0.0, 0.0)


@pytest.fixture
def driver(ros_context: Any, ros_executor: Any) -> SimDriver:
    values = {"cell": "open", "backend": "ideal", "wake_port": 0}
    overrides = [Parameter(key, value=value) for key, value in values.items()]
    return ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))


@pytest.fixture
def follow(driver: Any, ros_executor: Any, ros_node: Any, wait_for: Any) -> Any:
    """Send a goal as a plain client does; what its result says."""
    client = ros_executor.run(lambda: ActionClient(ros_node, Follow, names.FOLLOW_JOINT_TRAJECTORY))
    wait_for(client.server_is_ready, what="the action is offered")

    def send(goal: Any) -> Any:
        sent = ros_executor.run(lambda: client.send_goal_async(goal))
        wait_for(sent.done, what="the goal is taken")
        result = ros_executor.run(sent.result().get_result_async)
        wait_for(result.done, what="the goal ends")
        return result.result().result

    yield send
    ros_executor.run(client.destroy)


def goal(*offsets: float) -> Any:
    points = [
        JointTrajectoryPoint(
            positions=[START[0] + offset, *START[1:]], time_from_start=Duration(sec=k + 1)
        )
        for k, offset in enumerate(offsets)
    ]
    names_of = [f"joint_a{k}" for k in range(1, 7)]
    return Follow.Goal(trajectory=JointTrajectory(joint_names=names_of, points=points))


def test_a_goal_of_control_msgs_runs_and_a_bad_one_says_why(follow: Any) -> None:
    assert follow(goal(0.1, 0.0)).error_code == Follow.Result.SUCCESSFUL
    bad = goal(0.1)
    bad.trajectory.joint_names = ["elbow", *bad.trajectory.joint_names[1:]]
    refused = follow(bad)
    assert refused.error_code == Follow.Result.INVALID_JOINTS
    assert "elbow" in refused.error_string


def test_tolerances_of_other_kinds_of_joints_are_refused_by_name(follow: Any) -> None:
    asked = goal(0.1)
    asked.component_goal_tolerance = [control_messages.JointComponentTolerance()]
    refused = follow(asked)
    assert refused.error_code == ErrorCode.INVALID_GOAL
    assert refused.error_string.startswith("component_goal_tolerance has 1 entries")


def test_too_many_tolerances_of_a_goal_are_refused_before_they_are_read(follow: Any) -> None:
    asked = goal(0.1)
    asked.goal_tolerance = [control_messages.JointTolerance()] * 101
    assert follow(asked).error_string == "the goal has 101 goal tolerances: at most 100"


def test_the_state_is_told_for_a_time_and_published_and_the_speed_is_a_factor(
    driver: Any, follow: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    states: list[Any] = []
    ros_executor.run(
        lambda: ros_node.create_subscription(
            control_messages.JointTrajectoryControllerState,
            names.TRAJECTORY_CONTROLLER_STATE,
            states.append,
            10,
        )
    )
    kind = control_messages.SpeedScalingFactor
    factor = ros_executor.run(
        lambda: ros_node.create_publisher(kind, names.SPEED_SCALING_INPUT, 10)
    )
    wait_for(factor.get_subscription_count, what="the driver hears the factor")
    factor.publish(kind(factor=0.5))
    wait_for(lambda: states, what="the state is published")
    del states[:]
    assert follow(goal(0.3)).error_code == Follow.Result.SUCCESSFUL
    assert max(state.speed_scaling_factor for state in states) == pytest.approx(0.5)
    assert list(states[-1].joint_names) == list(driver._driver.joint_names)
    client = ros_executor.run(
        lambda: ros_node.create_client(control_services.QueryTrajectoryState, names.QUERY_STATE)
    )
    wait_for(client.service_is_ready, what="query_state is offered")
    request = control_services.QueryTrajectoryState.Request(time=driver.now_msg())
    request.time.sec += 1
    future = ros_executor.run(lambda: client.call_async(request))
    wait_for(future.done, what="query_state answers")
    assert future.result().success, future.result().message
    assert future.result().position[0] == pytest.approx(START[0] + 0.3, abs=1e-6)


def test_frames_come_on_tf(driver: Any, ros_executor: Any, ros_node: Any, wait_for: Any) -> None:
    frames = pytest.importorskip("tf2_msgs.msg", reason="tf2_msgs is missing")
    heard: set[str] = set()

    def hear(message: Any) -> None:
        heard.update(each.child_frame_id for each in message.transforms)

    ros_executor.run(lambda: ros_node.create_subscription(frames.TFMessage, names.TF, hear, 10))
    wait_for(lambda: {f"link_{k}" for k in range(1, 7)} <= heard, what="the links are on tf")
