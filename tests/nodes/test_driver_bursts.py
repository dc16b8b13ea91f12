"""Bursts over ROS: a press that is taken back at once counts, and every request and goal is
answered.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import rclpy
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import PlcInputs, PowerMode, PowerState
from ir_msgs.srv import QueryModes, Recover, SetPlcInput
from ir_msgs_py import names
from ir_msgs_py.ros.conversions import time_from_msg
from ir_msgs_py.ros.rclpy_inside import GoalRequests
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import ACTION_SERVICES, LATCHED, REQUESTS_WAITING, SERVICE
from ir_msgs_py.status import StatusCode
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.node import SimDriver
from ir_sim_driver.node.presses import PlcTopic
from ir_sim_driver.node.trajectory_actions import Executions

PRESSED = PlcInputs(emergency_stop=True, move_enable=True)
RELEASED = PlcInputs(move_enable=True)


@pytest.fixture
def modes(ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any) -> list[int]:
    """A standing driver; the modes that its power_state shows."""
    overrides = [Parameter("cell", value="open"), Parameter("backend", value="ideal")]
    overrides += [Parameter("wake_port", value=0), Parameter("plc.startup_window", value=0.0)]
    ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    heard: list[int] = []
    ros_executor.run(
        lambda: ros_node.create_subscription(
            PowerState, "/ir_sim_driver/power_state", lambda msg: heard.append(msg.mode), 100
        )
    )
    wait_for(lambda: len(heard) > 10, what="the driver publishes")
    assert PowerMode.EMERGENCY_STOP not in heard
    return heard


class Heard:
    """A driver that notes what the topic writes, and what it warns of."""

    def __init__(self) -> None:
        self.plc = self
        self.warn = lambda sentence: self.said.append(sentence)
        self.written: list[Any] = []
        self.pressed: list[Any] = []
        self.said: list[str] = []
        self.stop_number = 0

    def write_heard(self, _writer: str, written: Any) -> None:
        self.written.append([each.inputs for each in written])

    def write_inputs(self, _writer: str, levels: Any) -> None:
        self.pressed.append(levels)


def test_a_press_does_not_come_behind_old_levels_nor_with_a_mode_that_is_none(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    """A thread that gets no processor for a while takes all that have come in few turns."""
    driver = Heard()
    server = BackgroundExecutor(ros_context)
    try:
        node = server.add_node(rclpy.create_node("ir_sim_driver", context=ros_context))
        alone = SimpleNamespace(apart=False)
        topic = server.run(lambda: PlcTopic(node, driver, alone))  # type: ignore[arg-type]
        publisher = ros_executor.run(
            lambda: ros_node.create_publisher(
                PlcInputs, "/ir_sim_driver/plc_inputs", QoSProfile(depth=1000)
            )
        )
        wait_for(publisher.get_subscription_count, what="the driver listens")
        messages = [RELEASED] * 300 + [PRESSED] + [RELEASED] * 100
        ros_executor.run(lambda: [publisher.publish(each) for each in messages])
        ros_executor.run(
            lambda: publisher.publish(PlcInputs(emergency_stop=True, operating_mode=99))
        )
        wait_for(lambda: publisher.wait_for_all_acked(), what="all have come")
        turns: list[int] = []

        def taken_all() -> bool:
            turns.append(topic.poll())
            return bool(driver.pressed)

        wait_for(taken_all, what="the last one is taken")
    finally:
        server.close()
    taken = [levels for turn in driver.written for levels in turn]
    assert max(turns) <= 128  # a flood holds up no request of the press's service
    assert len(driver.written) < 10
    assert [levels.emergency_stop for levels in taken].count(True) == 1
    assert len(taken) < 20  # levels that are repeated are read once a turn
    assert not taken[0].emergency_stop
    assert not taken[-1].emergency_stop
    assert driver.pressed == [{"emergency_stop": True}]
    assert "99" in driver.said[0]


def test_what_waits_for_a_busy_node_while_a_stop_is_latched_moves_nothing_after_the_recovery(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    """By action and topic; the executor takes neither before the recovery."""
    positions: list[Any] = []
    busy = threading.Event()
    done = threading.Event()
    server = BackgroundExecutor(ros_context)
    parameters = {"cell": "open", "backend": "ideal", "wake_port": 0, "plc.startup_window": 0.0}
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    try:
        server.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
        ros_executor.run(
            lambda: ros_node.create_subscription(
                JointState, "/joint_states", lambda msg: positions.append(msg.position), 100
            )
        )
        name = "/ir_sim_driver/execute_trajectory"
        client, press, recover, topic = ros_executor.run(
            lambda: (
                ActionClient(ros_node, ExecuteTrajectory, name, **ACTION_SERVICES),
                ros_node.create_client(SetPlcInput, "/ir_sim_driver/set_plc_input"),
                ros_node.create_client(Recover, "/ir_sim_driver/recover"),
                ros_node.create_publisher(JointTrajectory, "/ir_sim_driver/joint_trajectory", 10),
            )
        )
        for ready in (client.server_is_ready, press.service_is_ready, recover.service_is_ready):
            wait_for(ready, what="the driver is there")
        wait_for(lambda: positions and topic.get_subscription_count(), what="the driver is heard")

        def call(service: Any, request: Any) -> Any:
            future = ros_executor.run(lambda: service.call_async(request))
            wait_for(future.done, what="the driver answers beside its executor")
            return future.result()

        def hold() -> None:
            busy.set()
            done.wait(PATIENCE)

        start = list(positions[-1])
        path = JointTrajectory(joint_names=list(names.JOINT_NAMES))
        point = JointTrajectoryPoint(positions=[start[0] + 0.1, *start[1:]], velocities=[0.0] * 6)
        point.time_from_start.sec = 1
        path.points = [point]
        holding = threading.Thread(target=lambda: server.run(hold))
        holding.start()
        busy.wait(PATIENCE)
        for level in (True, False):
            call(press, SetPlcInput.Request(name="emergency_stop", value=level))
        sent = ros_executor.run(
            lambda: client.send_goal_async(ExecuteTrajectory.Goal(trajectory=path))
        )
        ros_executor.run(lambda: topic.publish(path))
        wait_for(lambda: topic.wait_for_all_acked(), what="both have come")
        wait_for(
            lambda: call(recover, Recover.Request()).status.code == StatusCode.SUCCESS,
            what="the robot recovers",
        )
        done.set()
        holding.join()
        wait_for(sent.done, what="the goal is taken")
        result = ros_executor.run(sent.result().get_result_async)
        wait_for(result.done, what="the goal ends")
        heard = len(positions)
        wait_for(lambda: len(positions) > heard + 500, what="a second passes")
        client.destroy()
    finally:
        done.set()
        server.close()
    assert result.result().result.error_code == -1
    assert max(abs(each[0] - start[0]) for each in positions) < 0.01


def test_no_goal_is_taken_after_a_recovery_by_plc_before_those_that_wait_are_refused(
    ros_context: Any, ros_executor: Any, wait_for: Any
) -> None:
    """However long the thread that takes them gets no processor."""
    parameters = {"cell": "open", "backend": "ideal", "wake_port": 0, "plc.startup_window": 0.0}
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    node = ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    requests = node._threads[1]
    requests.close()
    driver = node._driver
    for bit in ("emergency_stop", "conf_mess", "drives_on"):
        for level in (True, False):
            driver.press("service", bit, level)
            begin = driver.stamp_ns
            wait_for(lambda begin=begin: driver.stamp_ns > begin + 60_000_000, what="levels count")
    wait_for(lambda: not driver.stopped, what="the PLC recovers")
    assert "stop 1 came after" in node._admit(2, 0, 0).refusal
    assert node._refuse_waiting()
    assert node._admit(2, 0, 0).ticket


@pytest.mark.parametrize("late", [True, False])
def test_a_goal_that_comes_long_after_it_was_sent_is_as_old_as_it_is(
    late: bool,
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    wait_for: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its first datagram is lost, and its sender's middleware sends it again after a stop and the
    recovery; what is sent after that is driven.
    """
    lost = threading.Event()
    plain = GoalRequests.take

    def take(requests: GoalRequests, kind: Any, sent: Any) -> Any:
        return None if lost.is_set() else plain(requests, kind, sent)

    monkeypatch.setattr(GoalRequests, "take", take)
    parameters = {"cell": "open", "backend": "ideal", "wake_port": 0, "plc.startup_window": 0.0}
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    node = ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    driver = node._driver
    name = "/ir_sim_driver/execute_trajectory"
    client = ros_executor.run(
        lambda: ActionClient(ros_node, ExecuteTrajectory, name, **ACTION_SERVICES)
    )
    wait_for(client.server_is_ready, what="the driver is there")
    recoveries: list[Header] = []
    ros_executor.run(
        lambda: ros_node.create_subscription(
            Header, f"/{names.LAST_RECOVERY}", recoveries.append, LATCHED
        )
    )
    wait_for(lambda: recoveries, what="there was no stop yet")
    assert time_from_msg(recoveries[0].stamp) == 0
    path = JointTrajectory(joint_names=list(names.JOINT_NAMES))
    start = [float(q) for q in np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])]
    point = JointTrajectoryPoint(positions=[start[0] + 0.1, *start[1:]], velocities=[0.0] * 6)
    point.time_from_start.sec = 1
    path.points = [point]

    def send() -> Any:
        goal = ExecuteTrajectory.Goal(trajectory=path)
        return ros_executor.run(lambda: client.send_goal_async(goal))

    if late:
        lost.set()
        sent = send()
    for level in (True, False):
        driver.press("service", "emergency_stop", level)
        begin = driver.stamp_ns
        wait_for(lambda begin=begin: driver.stamp_ns > begin + 60_000_000, what="levels count")

    def recovered() -> bool:
        with suppress(RequestRefusedError):
            driver.recover()
        return not driver.stopped

    wait_for(recovered, what="the robot recovers")
    wait_for(lambda: int(recoveries[-1].frame_id) == driver.stop_number, what="it is told")
    wait_for(node._refuse_waiting, what="nothing waits")
    if not late:
        assert time_from_msg(recoveries[-1].stamp) < time.time_ns()
        sent = send()
    lost.clear()
    wait_for(sent.done, what="the goal is taken")
    result = ros_executor.run(sent.result().get_result_async)
    wait_for(result.done, what="the goal ends")
    client.destroy()
    outcome = result.result().result
    if late:
        assert outcome.error_code == -1
        assert "s before stop 1 was recovered, by its sender's clock" in outcome.error_string
    else:
        assert outcome.error_code == 0, outcome.error_string


@pytest.mark.parametrize(
    "durability", [DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE]
)
def test_a_press_by_topic_that_is_taken_back_at_once_is_latched(
    modes: list[int], ros_node: Any, ros_executor: Any, wait_for: Any, durability: DurabilityPolicy
) -> None:
    quality = QoSProfile(depth=10, durability=durability)
    topic = "/ir_sim_driver/plc_inputs"
    publisher = ros_executor.run(lambda: ros_node.create_publisher(PlcInputs, topic, quality))
    matched = 1 if durability == DurabilityPolicy.VOLATILE else 2
    wait_for(lambda: publisher.get_subscription_count() == matched, what="the driver listens")

    def press() -> None:
        publisher.publish(PRESSED)
        for _ in range(5):
            publisher.publish(RELEASED)

    ros_executor.run(press)
    wait_for(lambda: PowerMode.EMERGENCY_STOP in modes, what="the stop is latched")
    del modes[:]
    wait_for(lambda: len(modes) > 50, what="the driver goes on publishing")
    assert set(modes) == {PowerMode.EMERGENCY_STOP}


def test_a_press_by_service_counts_in_a_burst_and_all_are_answered(
    modes: list[int], ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    client = ros_executor.run(
        lambda: ros_node.create_client(
            SetPlcInput, "/ir_sim_driver/set_plc_input", qos_profile=SERVICE
        )
    )
    wait_for(client.service_is_ready, what="set_plc_input is offered")
    requests = [SetPlcInput.Request(name="emergency_stop", value=k == 0) for k in range(200)]
    futures = ros_executor.run(lambda: [client.call_async(request) for request in requests])
    wait_for(lambda: all(future.done() for future in futures), what="all are answered")
    wait_for(lambda: PowerMode.EMERGENCY_STOP in modes, what="the stop is latched")


@pytest.mark.long  # test_serving.py has the same with fewer requests
def test_more_requests_than_may_wait_are_all_answered(
    modes: list[int], ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    client = ros_executor.run(
        lambda: ros_node.create_client(
            QueryModes, "/ir_sim_driver/query_modes", qos_profile=SERVICE
        )
    )
    wait_for(client.service_is_ready, what="query_modes is offered")
    sent = range(REQUESTS_WAITING + 200)
    futures = ros_executor.run(lambda: [client.call_async(QueryModes.Request()) for _ in sent])
    wait_for(lambda: all(future.done() for future in futures), what="all are answered")
    refusals = {future.result().status.message for future in futures} - {""}
    assert all("are waiting: send fewer at once" in sentence for sentence in refusals)


def test_a_goal_that_is_cancelled_before_it_begins_is_cancelled() -> None:
    """A thread may take the cancel before the goal's own coroutine runs."""
    cancelled: list[int] = []
    driver = SimpleNamespace(
        max_points=10, submit=lambda points, read, ended, ticket: 7, cancel=cancelled.append
    )
    node = SimpleNamespace(
        future=lambda: asyncio.Future(loop=loop), every=lambda seconds, call: lambda: None
    )
    loop = asyncio.new_event_loop()
    goals = Executions(cast(Any, driver), cast(Any, node), ExecuteTrajectory, 0.0)
    handle = SimpleNamespace(
        goal_id=SimpleNamespace(uuid=range(16)), request=ExecuteTrajectory.Goal()
    )
    goals.cancel(handle)
    assert cancelled == []
    running = goals.execute(handle)
    running.send(None)
    assert cancelled == [7]
    running.close()
    loop.close()


def test_forty_goals_are_all_answered_with_a_result(
    modes: list[int], ros_node: Any, ros_executor: Any, wait_for: Callable[..., Any]
) -> None:
    client = ros_executor.run(
        lambda: ActionClient(
            ros_node, ExecuteTrajectory, "/ir_sim_driver/execute_trajectory", **ACTION_SERVICES
        )
    )
    wait_for(client.server_is_ready, what="execute_trajectory is offered")
    sent = ros_executor.run(
        lambda: [client.send_goal_async(ExecuteTrajectory.Goal()) for _ in range(40)]
    )
    wait_for(lambda: all(future.done() for future in sent), what="all goals are taken")
    goals = [future.result() for future in sent]
    results = ros_executor.run(lambda: [goal.get_result_async() for goal in goals if goal.accepted])
    wait_for(lambda: all(future.done() for future in results), what="all goals end")
    assert len(results) == 40
    assert all(future.result().result.error_string for future in results)
