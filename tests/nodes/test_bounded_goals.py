"""Goals of more points than may be are refused before Python objects are made of the points."""

from __future__ import annotations

from typing import Any

import pytest
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from trajectory_msgs.msg import JointTrajectoryPoint, MultiDOFJointTrajectoryPoint

from ir_msgs.action import ExecuteTrajectory
from ir_msgs_py.ros.topics import ACTION_SERVICES
from ir_sim_driver.node import SimDriver, node
from ir_sim_driver.node import trajectory_actions as bounded_goals

MOST = 10


def goal(points: int, multi_dof: int = 0) -> ExecuteTrajectory.Goal:
    sent = ExecuteTrajectory.Goal(trajectory_id="counted")
    sent.trajectory.joint_names = [f"joint_a{k}" for k in range(1, 7)]
    sent.trajectory.points = [JointTrajectoryPoint(positions=[0.5] * 6) for _ in range(points)]
    sent.multi_dof_trajectory.points = [MultiDOFJointTrajectoryPoint() for _ in range(multi_dof)]
    return sent


def taken(sent: ExecuteTrajectory.Goal, most: int) -> tuple[Any, int]:
    """A request as the server converts it, and how many points it left out."""
    from rclpy.impl.implementation_singleton import rclpy_implementation
    from rclpy.serialization import serialize_message

    kind = ExecuteTrajectory.Impl.SendGoalService.Request
    counted = bounded_goals._CountedRequest(kind, lambda: most)
    request = kind(goal=sent)
    request.goal_id.uuid[:] = range(16)
    return rclpy_implementation.rclpy_deserialize(
        serialize_message(request), counted.as_class
    ), counted.left_out


def test_a_goal_within_the_bound_is_whole() -> None:
    request, left_out = taken(goal(MOST, 1), MOST)
    assert left_out == 0
    assert request.goal == goal(MOST, 1)
    assert list(request.goal_id.uuid) == list(range(16))


@pytest.mark.parametrize(
    ("points", "multi_dof"), [(MOST + 1, 0), (5000, 0), (2, MOST + 1), (0, 5000)]
)
def test_beyond_it_all_but_the_points_are_there(points: int, multi_dof: int) -> None:
    for _ in range(3):  # the points are freed, too
        request, left_out = taken(goal(points, multi_dof), MOST)
    assert left_out == max(points, multi_dof)
    assert not request.goal.trajectory.points
    assert not request.goal.multi_dof_trajectory.points
    assert request.goal == goal(0)


def test_the_driver_refuses_it_with_the_count_and_forgets_it_soon(
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    wait_for: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert node._RESULT_KEPT <= 60
    monkeypatch.setattr(node, "_RESULT_KEPT", 1)
    overrides = [Parameter("cell", value="open"), Parameter("backend", value="ideal")]
    overrides += [Parameter("wake_port", value=0), Parameter("execution.max_points", value=MOST)]
    driver = ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    client = ros_executor.run(
        lambda: ActionClient(
            ros_node, ExecuteTrajectory, "/ir_sim_driver/execute_trajectory", **ACTION_SERVICES
        )
    )
    wait_for(client.server_is_ready, what="execute_trajectory is offered")
    most = bounded_goals._CLIENTS_KEPT
    server = driver._actions[0]
    server._clients.update(
        {k.to_bytes(16, "big"): b"" for k in range(most)}
    )  # of goals that never ran
    sent = ros_executor.run(lambda: client.send_goal_async(goal(3000)))
    wait_for(sent.done, what="the goal is taken")
    result = ros_executor.run(lambda: sent.result().get_result_async())
    wait_for(result.done, what="the goal ends")
    answer = result.result().result
    assert answer.error_code == ExecuteTrajectory.Result.INVALID_GOAL
    assert f"the trajectory has 3000 points: at most {MOST}" in answer.error_string
    assert len(server._clients) < most
    wait_for(lambda: not server._goal_handles, what="goal and result are forgotten")
