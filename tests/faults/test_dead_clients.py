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
from ir_msgs_py.ros import goal_clients
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.goal_clients import ClientWatch
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.node import SimDriver


@pytest.fixture
def ros_discovery_range() -> str:
    """Two contexts meet."""
    return "SYSTEM_DEFAULT"


def long_movement() -> JointTrajectory:
    there = np.array(load_cell("open").machine_home) + 0.4 * np.eye(6)[0]
    return JointTrajectory.from_seconds(names.JOINT_NAMES, [200.0], there[None], np.zeros((1, 6)))


def bare_client(node: Any, goal: Any) -> tuple[Any, Any]:
    """A client of the service for goals alone, that hears no feedback: what ends it, and the
    future of its goal.
    """
    service = f"{names.EXECUTE_TRAJECTORY}/_action/send_goal"
    client = node.create_client(ExecuteTrajectory.Impl.SendGoalService, service)
    assert client.wait_for_service(10.0)
    request = ExecuteTrajectory.Impl.SendGoalService.Request(goal=goal)
    request.goal_id.uuid = list(range(16))
    return node.destroy_node, client.call_async(request)


def test_a_movement_whose_client_has_gone_is_stopped_though_others_are_there(
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    ros_domain_id: int,
    wait_for: Any,
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

    def processes() -> int:
        return len({each[:12] for each in driver._actions[0]._clients.now()})

    context = Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    guest = BackgroundExecutor(context)
    try:
        node = guest.add_node(rclpy.create_node("guest", context=context))
        goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(long_movement()))
        leave, accepted = guest.run(lambda: bare_client(node, goal))
        wait_for(accepted.done)
        wait_for(lambda: driver._driver.moving, what="the movement runs")
        wait_for(lambda: processes() == 2, what="both clients are known")
        guest.run(leave)
    finally:
        guest.close()
        context.try_shutdown()
    wait_for(lambda: not driver._driver.moving, what="the movement stops")
    wait_for(lambda: processes() == 1, what="the other one is left")


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


def test_a_watch_that_was_held_up_itself_does_not_take_that_for_an_absence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [100.0]
    monkeypatch.setattr(goal_clients.time, "monotonic", lambda: now[0])
    watch = ClientWatch(2.0, b"p" * 12)
    assert not watch.gone([b"p" * 12])
    now[0] += 15.0  # the graph has forgotten its client meanwhile, and finds it again
    assert not watch.gone([])
    now[0] += 0.2
    assert not watch.gone([b"p" * 12])
    for _ in range(3):
        now[0] += 1.0
        left = watch.gone([])
    assert left


def test_a_client_that_never_shows_in_the_graph_counts_as_gone_whoever_else_is_there() -> None:
    other = [b"q" * 12 + b"feed"]
    assert ClientWatch(1e-9, b"p" * 12, discovery=0.0).gone(other)
    assert not ClientWatch(1e-9, b"", discovery=0.0).gone(other)
