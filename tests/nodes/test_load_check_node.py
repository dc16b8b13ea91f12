"""What the load check finds is in the result, on its topic and in the diagnostics."""

from __future__ import annotations

from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.parameter import Parameter

from ir_description import load_cell
from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import LoadCheck
from ir_msgs_py import names
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.topics import ACTION_SERVICES, LATCHED
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.node import SimDriver


def test_a_load_that_is_not_the_declared_one_is_said_to_everybody(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    values = {"cell": "demo", "backend": "ideal", "wake_port": 0, "load_check.mass_error": 0.3}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    heard: list[LoadCheck] = []
    warned: list[str] = []

    def diagnosed(msg: DiagnosticArray) -> None:
        warned.extend(each.message for each in msg.status if each.level == DiagnosticStatus.WARN)

    def connect() -> ActionClient:
        ros_node.create_subscription(LoadCheck, f"/{names.LOAD_CHECK}", heard.append, LATCHED)
        ros_node.create_subscription(DiagnosticArray, names.DIAGNOSTICS, diagnosed, 10)
        return ActionClient(
            ros_node, ExecuteTrajectory, f"/{names.EXECUTE_TRAJECTORY}", **ACTION_SERVICES
        )

    client = ros_executor.run(connect)
    wait_for(client.server_is_ready, what="execute_trajectory is offered")
    cell = load_cell("demo")
    q = np.array(cell.machine_home)
    rest = np.zeros((2, 6))
    there = q + np.array([0.0, 0.2, 0.0, 0.0, 0.0, 0.0])
    trajectory = JointTrajectory.from_seconds(
        cell.robot.joint_names, [0.0, 1.5], [q, there], rest, rest
    )
    goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(trajectory), trajectory_id="up")
    sent = ros_executor.run(lambda: client.send_goal_async(goal))
    wait_for(sent.done, what="the goal is taken")
    ended = ros_executor.run(lambda: sent.result().get_result_async())
    wait_for(ended.done, what="the movement ends")
    result = ended.result().result
    assert result.error_code == ExecuteTrajectory.Result.SUCCESSFUL
    (found,) = result.load_check
    assert found.noticed
    assert (found.trajectory_id, found.load) == ("up", "gripper")
    assert found.sentence in result.error_string
    wait_for(lambda: heard and heard[-1].sentence == found.sentence, what="the topic says the same")
    wait_for(
        lambda: any(found.sentence in text for text in warned), what="the diagnostics say the same"
    )
