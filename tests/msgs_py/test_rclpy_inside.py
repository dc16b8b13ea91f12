"""Clients that have gone end no executor, and without rclpy's insides nodes behave as plain rclpy.

What the middleware says of a client that has gone is raised here by rclpy's own handles.
"""

from __future__ import annotations

import threading
import time
import warnings
from contextlib import suppress
from typing import Any

import pytest
import rclpy
from rcl_interfaces.srv import ListParameters
from rclpy.action import ActionClient, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_msgs.msg import Int32

from ir_msgs.action import RunProgram
from ir_msgs.srv import SetPlcInput
from ir_msgs_py.ros import rclpy_inside
from ir_msgs_py.ros.serving import BoundedService, RecordedActionServer
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import CommandTopic, LatestMessage, PolledTopic
from ir_msgs_py.status import StatusCode
from ir_recorder.format.qos import QosOffer
from ir_recorder.node.subscriptions import TopicListener

RESPONSES = ("send_goal_response", "send_cancel_response", "send_result_response")


def no_client() -> None:
    raise _rclpy.RCLError("Failed to send response: client will not receive response")


def no_server() -> None:
    raise _rclpy.InvalidHandle("cannot use Destroyable because destruction was requested")


def a_warning() -> None:
    """As rclpy's C code raises it under a filter."""
    raise SystemError("returned a result with an exception set") from RuntimeWarning(
        "failed to send response (timeout)"
    )


@pytest.fixture(params=[no_client, no_server, a_warning], ids=lambda gone: gone.__name__)
def gone(request: pytest.FixtureRequest) -> Any:
    return request.param


def answer(_request: Any, response: Any) -> Any:
    response.status.code = StatusCode.SUCCESS
    return response


class Server:
    """A node with an action and a service, on an executor whose failures are raised at the end."""

    def __init__(self, context: Any) -> None:
        self.executor = BackgroundExecutor(context)
        self.node = self.executor.add_node(rclpy.create_node("server", context=context))
        self.ended = Future()
        self.asked: list[Any] = []
        self.executor.run(self._make)

    def _make(self) -> None:
        self.action = RecordedActionServer(
            self.node, RunProgram, "~/run", self._execute, cancel_callback=self._cancel
        )
        self.service = BoundedService(self.node, SetPlcInput, "~/ask", answer)

    async def _execute(self, goal: Any) -> Any:
        self.asked.append(goal.request.program_id)
        await self.ended
        goal.canceled()
        return RunProgram.Result(executed=3)

    def _cancel(self, _goal: Any) -> CancelResponse:
        self.ended.set_result(None)
        return CancelResponse.ACCEPT

    def close(self) -> None:
        self.executor.run(self.action.destroy)
        self.executor.close()


def run_and_cancel(executor: Any, node: Any, wait_for: Any) -> int:
    """Send a goal, cancel it, and return how many steps its result says."""
    client = executor.run(lambda: ActionClient(node, RunProgram, "/server/run"))
    wait_for(client.server_is_ready, what="the action is offered")
    sent = executor.run(lambda: client.send_goal_async(RunProgram.Goal(program_id="one")))
    wait_for(sent.done, what="the goal is taken")
    result = executor.run(sent.result().get_result_async)
    ending = executor.run(sent.result().cancel_goal_async)
    wait_for(lambda: result.done() and ending.done(), what="the goal has ended")
    executor.run(client.destroy)
    return int(result.result().result.executed)


def ask(executor: Any, node: Any, wait_for: Any, kind: Any = SetPlcInput, name: str = "ask") -> Any:
    """Call a service of the server."""
    client = executor.run(lambda: node.create_client(kind, f"/server/{name}"))
    wait_for(client.service_is_ready, what="the service is offered")
    future = executor.run(lambda: client.call_async(kind.Request()))
    wait_for(future.done, what="the answer")
    return future.result()


@pytest.mark.parametrize("kind", RESPONSES)
def test_a_client_of_an_action_that_has_gone_ends_no_executor(
    kind: str,
    gone: Any,
    monkeypatch: pytest.MonkeyPatch,
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    wait_for: Any,
) -> None:
    """The first response of this kind finds nobody; the next client is served."""
    found_nobody: list[str] = []
    owner: Any = _rclpy.ActionServer
    sender = kind
    if kind == "send_goal_response":  # a request that is taken with its time is answered aside
        owner = rclpy_inside.GoalRequests
        sender = "answer"
    plain = getattr(owner, sender)

    def send(handle: Any, header: Any, response: Any) -> None:
        if found_nobody:
            plain(handle, header, response)
        else:
            found_nobody.append(kind)
            gone()

    monkeypatch.setattr(owner, sender, send)
    server = Server(ros_context)
    try:
        client = ros_executor.run(lambda: ActionClient(ros_node, RunProgram, "/server/run"))
        wait_for(client.server_is_ready, what="the action is offered")
        sent = ros_executor.run(lambda: client.send_goal_async(RunProgram.Goal()))
        if kind != "send_goal_response":
            wait_for(sent.done, what="the goal is taken")
            ros_executor.run(sent.result().get_result_async)
            ros_executor.run(sent.result().cancel_goal_async)
        wait_for(lambda: found_nobody, what="the response finds nobody")
        executed = kind != "send_goal_response" or gone is a_warning
        if executed:
            wait_for(lambda: server.asked, what="a goal that was accepted is executed")
        ros_executor.run(client.destroy)
        server.ended = Future()
        assert run_and_cancel(ros_executor, ros_node, wait_for) == 3
        assert len(server.asked) == 1 + executed
    finally:
        server.close()


def test_goals_are_taken_with_the_time_at_which_they_were_written(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    came: list[int] = []
    server = BackgroundExecutor(ros_context)
    node = server.add_node(rclpy.create_node("server", context=ros_context))
    action = server.run(
        lambda: RecordedActionServer(
            node,
            RunProgram,
            "~/run",
            lambda goal: RunProgram.Result(),
            goal_callback=lambda goal: GoalResponse.REJECT,
            came=lambda goal_id, sent: came.append(sent),
        )
    )
    client = ros_executor.run(lambda: ActionClient(ros_node, RunProgram, "/server/run"))
    try:
        wait_for(client.server_is_ready, what="the action is offered")
        for _ in range(20):
            before = time.time_ns()
            sent = ros_executor.run(lambda: client.send_goal_async(RunProgram.Goal()))
            wait_for(sent.done, what="the goal is answered")
            assert not sent.result().accepted
            assert before <= came[-1] <= time.time_ns()
        assert len(came) == 20
    finally:
        ros_executor.run(client.destroy)
        server.run(action.destroy)
        server.close()


def test_goals_of_a_client_are_accepted_in_the_order_in_which_they_were_sent(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    """While the first is looked at the others come, on threads of their own."""
    node = rclpy.create_node("server", context=ros_context)
    executor = MultiThreadedExecutor(num_threads=6, context=ros_context)
    executor.add_node(node)
    all_came = threading.Event()
    came: list[bytes] = []
    accepted: list[str] = []

    def note(goal_id: bytes, _sent: int) -> None:
        came.append(goal_id)
        if len(came) == 5:
            all_came.set()

    def look(goal: Any) -> GoalResponse:
        if goal.program_id == "0":
            assert all_came.wait(PATIENCE)
        if goal.program_id == "2":
            raise RuntimeError("nothing can be said of this goal")
        return GoalResponse.ACCEPT

    action = RecordedActionServer(
        node,
        RunProgram,
        "~/run",
        lambda goal: RunProgram.Result(),
        goal_callback=look,
        handle_accepted_callback=lambda goal: accepted.append(goal.request.program_id),
        came=note,
        callback_group=ReentrantCallbackGroup(),
    )

    def spin() -> None:
        while ros_context.ok() and len(accepted) < 4:
            with suppress(RuntimeError):
                executor.spin_once(timeout_sec=0.1)

    spinning = threading.Thread(target=spin)
    client = ros_executor.run(lambda: ActionClient(ros_node, RunProgram, "/server/run"))
    spinning.start()
    try:
        wait_for(client.server_is_ready, what="the action is offered")
        for name in "01234":
            goal = RunProgram.Goal(program_id=name)
            ros_executor.run(lambda goal=goal: client.send_goal_async(goal))
        spinning.join(PATIENCE)
        assert accepted == ["0", "1", "3", "4"]
    finally:
        ros_executor.run(client.destroy)
        executor.shutdown(timeout_sec=PATIENCE)
        action.destroy()
        node.destroy_node()


def test_a_client_of_a_service_that_has_gone_ends_no_executor(
    gone: Any,
    monkeypatch: pytest.MonkeyPatch,
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    wait_for: Any,
) -> None:
    """Neither of ours nor of rclpy's own."""
    found_nobody: list[Any] = []
    plain = _rclpy.Service.service_send_response

    def send(handle: Any, response: Any, header: Any) -> None:
        found_nobody.append(response)
        gone()

    monkeypatch.setattr(rclpy_inside, "aside_sender", lambda service: service.send_response)
    server = Server(ros_context)
    try:
        monkeypatch.setattr(_rclpy.Service, "service_send_response", send)
        for kind, name in ((SetPlcInput, "ask"), (ListParameters, "list_parameters")):
            client = ros_executor.run(
                lambda kind=kind, name=name: ros_node.create_client(kind, f"/server/{name}")
            )
            wait_for(client.service_is_ready, what="the service is offered")
            before = len(found_nobody)
            ros_executor.run(lambda client=client, kind=kind: client.call_async(kind.Request()))
            wait_for(lambda before=before: len(found_nobody) > before, what="nobody is found")
        monkeypatch.setattr(_rclpy.Service, "service_send_response", plain)
        assert ask(ros_executor, ros_node, wait_for).status.code == StatusCode.SUCCESS
        ask(ros_executor, ros_node, wait_for, ListParameters, "list_parameters")
    finally:
        server.close()


def test_a_response_that_is_sent_aside_arrives_and_what_can_t_be_sent_is_raised(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    server = Server(ros_context)
    try:
        plain = server.executor.run(
            lambda: server.node.create_service(SetPlcInput, "~/raw", answer)
        )
        sent: list[Any] = []
        send = rclpy_inside.aside_sender(plain)
        assert send != plain.send_response  # this rclpy has what it takes

        def note(response: Any, header: Any) -> None:
            sent.append((response, header))
            send(response, header)

        plain.send_response = note
        assert ask(ros_executor, ros_node, wait_for, name="raw").status.code == StatusCode.SUCCESS
    finally:
        server.close()
    with pytest.raises(rclpy_inside.UNSENT):
        send(*sent[0])
    with pytest.raises(TypeError):
        send(ListParameters.Response(), sent[0][1])


def test_a_warning_of_the_c_code_stays_one_under_a_filter_that_raises() -> None:
    def warn() -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                warnings.warn("late", RuntimeWarning, stacklevel=1)
            except RuntimeWarning as error:
                raise SystemError("with an exception set") from error

    rclpy_inside.send(warn)
    with pytest.raises(SystemError):
        rclpy_inside.send(lambda: (_ for _ in ()).throw(SystemError("a bug")))


@pytest.fixture
def plain_rclpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """An rclpy of which nothing but the documented part is known."""
    monkeypatch.setattr(rclpy_inside, "part", lambda owner, name: None)


def test_without_insides_services_and_actions_answer(
    plain_rclpy: None, ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    server = Server(ros_context)
    try:
        assert ask(ros_executor, ros_node, wait_for).status.code == StatusCode.SUCCESS
        assert run_and_cancel(ros_executor, ros_node, wait_for) == 3
    finally:
        server.close()


def test_without_insides_topics_are_heard(
    plain_rclpy: None, ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    commanded: list[int] = []
    polled: list[int] = []
    latest: list[int] = []

    def listen() -> tuple[Any, Any, Any]:
        CommandTopic(ros_node, Int32, "/numbers", lambda new: commanded.extend(m.data for m in new))
        return (
            ros_node.create_publisher(Int32, "/numbers", QoSProfile(depth=10)),
            PolledTopic(ros_node, Int32, "/numbers", QoSProfile(depth=10)),
            LatestMessage(ros_node, Int32, "/numbers"),
        )

    publisher, topic, newest = ros_executor.run(listen)

    def look() -> bool:
        polled.extend(message.data for message in topic.take())
        received = newest.take()
        if received is not None:
            latest.append(received.message.data)
        return polled == commanded == [1, 2, 3] and latest[-1:] == [3]

    wait_for(lambda: publisher.get_subscription_count() == 3, what="all listen")
    for number in (1, 2, 3):
        ros_executor.run(lambda number=number: publisher.publish(Int32(data=number)))
    wait_for(look, what="every message is there")


def test_without_insides_the_recorder_hears_the_bytes(
    plain_rclpy: None, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    publisher = ros_executor.run(
        lambda: ros_node.create_publisher(Int32, "/numbers", QoSProfile(depth=10))
    )
    listener = ros_executor.run(lambda: TopicListener(ros_node, 10))
    ros_executor.run(lambda: listener.open("/numbers", "std_msgs/msg/Int32", [QosOffer()]))
    wait_for(publisher.get_subscription_count, what="it listens")
    heard: list[int] = []

    def look() -> bool:
        arrived = ros_executor.run(listener.take)
        heard.extend(deserialize_message(each.data, Int32).data for each in arrived)
        return heard == [1, 2, 3]

    for number in (1, 2, 3):
        ros_executor.run(lambda number=number: publisher.publish(Int32(data=number)))
    wait_for(look, what="every message is there")
    ros_executor.run(listener.close)
