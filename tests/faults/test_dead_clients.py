"""Who asked for a movement and is gone does not keep the robot moving, whoever else is there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.parameter import Parameter

from ir_description import load_cell
from ir_msgs.action import ExecuteTrajectory
from ir_msgs_py import names
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.node import SimDriver
from ir_sim_driver.node.trajectory_actions import ClientWatch


@pytest.fixture
def ros_discovery_range() -> str:
    """Two contexts meet."""
    return "LOCALHOST"


def long_movement() -> JointTrajectory:
    there = np.array(load_cell("open").machine_home) + 0.4 * np.eye(6)[0]
    return JointTrajectory.from_seconds(names.JOINT_NAMES, [200.0], there[None], np.zeros((1, 6)))


def test_a_movement_whose_client_has_gone_is_stopped_though_others_are_there(
    ros_context: Any, ros_executor: Any, ros_node: Any, ros_domain_id: int, wait_for: Any
) -> None:
    """As the program runner's, which is always there. A context is a participant, as a process
    is.
    """
    given = {"cell": "open", "backend": "ideal", "wake_port": 0, "client_timeout": 0.3}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    driver = ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    another = ros_executor.run(
        lambda: ActionClient(ros_node, ExecuteTrajectory, names.EXECUTE_TRAJECTORY)
    )
    wait_for(another.server_is_ready)
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    guest = BackgroundExecutor(context)
    try:
        node = guest.add_node(rclpy.create_node("guest", context=context))
        client = guest.run(lambda: ActionClient(node, ExecuteTrajectory, names.EXECUTE_TRAJECTORY))
        wait_for(client.server_is_ready)
        goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(long_movement()))
        heard: list[Any] = []
        accepted = guest.run(lambda: client.send_goal_async(goal, feedback_callback=heard.append))
        wait_for(accepted.done)
        feedback = f"{names.EXECUTE_TRAJECTORY}/_action/feedback"
        wait_for(lambda: len(heard) > 2, what="the driver knows its client")
        wait_for(lambda: len(driver.subscribers(feedback)) == 2, what="both clients are known")
        guest.run(client.destroy)
    finally:
        guest.close()
        context.try_shutdown()
    wait_for(lambda: not driver._driver.moving, what="the movement stops")
    wait_for(lambda: len(driver.subscribers(feedback)) == 1, what="the other one is left")


def test_a_client_counts_by_its_process_once_that_is_known() -> None:
    own = b"p" * 12
    other = b"q" * 12
    watch = ClientWatch(1e-9, own)
    assert not watch.gone([other + b"feed"])  # its own has not been discovered yet
    assert not watch.gone([other + b"feed", own + b"feed"])
    assert watch.gone([other + b"feed"])
    assert not ClientWatch(1e-9).gone([other + b"feed"])  # a middleware that names nobody
    assert ClientWatch(1e-9, own).gone([])
    assert not ClientWatch(0.0, own).gone([])
