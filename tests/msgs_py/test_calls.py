"""Law: what a node was asked and answered reaches a recorder as it was, within a bound, and nobody
else.
"""

from __future__ import annotations

from typing import Any

import pytest
import rclpy
from rclpy.action import ActionClient
from rclpy.serialization import deserialize_message

from ir_msgs.action import RunProgram
from ir_msgs.msg import RecordedCall
from ir_msgs.srv import GetCell, SetPlcInput
from ir_msgs_py.ros import serving as calls
from ir_msgs_py.ros.serving import MOST_BYTES, BoundedService, Calls, RecordedActionServer


@pytest.fixture
def asked(ros_context: Any, ros_executor: Any) -> Any:
    """A node that answers a service and an action; both change their request meanwhile."""
    node = ros_executor.add_node(rclpy.create_node("asked", context=ros_context))

    def set_input(
        request: SetPlcInput.Request, response: SetPlcInput.Response
    ) -> SetPlcInput.Response:
        response.status.message = f"{request.name} is set"
        request.name = ""
        return response

    def run(goal: Any) -> RunProgram.Result:
        goal.succeed()
        goal.request.program_id = ""
        return RunProgram.Result(executed=3)

    ros_executor.run(lambda: BoundedService(node, SetPlcInput, "~/set", set_input))
    server = ros_executor.run(lambda: RecordedActionServer(node, RunProgram, "asked/run", run))
    yield node
    ros_executor.run(server.destroy)


@pytest.fixture
def heard(asked: Any, ros_executor: Any, ros_node: Any, wait_for: Any) -> list[RecordedCall]:
    """Calls as a recorder hears them."""
    found: list[RecordedCall] = []
    ros_executor.run(
        lambda: ros_node.create_subscription(RecordedCall, "/asked/calls", found.append, 100)
    )
    wait_for(
        lambda: Calls.of(asked)._publisher.get_subscription_count(),
        what="the recorder is discovered",
    )
    return found


def ask(ros_executor: Any, ros_node: Any, wait_for: Any) -> str:
    client = ros_executor.run(lambda: ros_node.create_client(SetPlcInput, "/asked/set"))
    wait_for(client.service_is_ready, what="the service is offered")
    future = ros_executor.run(
        lambda: client.call_async(SetPlcInput.Request(name="hib", value=True))
    )
    wait_for(future.done, what="it answers")
    return str(future.result().status.message)


def test_a_service_is_recorded_as_it_was_asked_and_answered(
    heard: list[RecordedCall], ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    assert ask(ros_executor, ros_node, wait_for) == "hib is set"
    wait_for(lambda: heard, what="the call is heard")
    call = heard[0]
    assert (call.node, call.service, call.type) == (
        "/asked",
        "/asked/set",
        "ir_msgs/srv/SetPlcInput",
    )
    request = deserialize_message(bytes(call.request), SetPlcInput.Request)
    response = deserialize_message(bytes(call.response), SetPlcInput.Response)
    assert (request.name, request.value, response.status.message) == ("hib", True, "hib is set")
    assert call.header.stamp.sec > 0


def test_the_goal_and_the_result_of_an_action_are_recorded(
    heard: list[RecordedCall], ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    client = ros_executor.run(lambda: ActionClient(ros_node, RunProgram, "/asked/run"))
    wait_for(client.server_is_ready, what="the action is offered")
    ros_executor.run(lambda: client.send_goal_async(RunProgram.Goal(program_id="abc")))
    wait_for(lambda: heard, what="the call is heard")
    ros_executor.run(client.destroy)
    call = heard[0]
    assert (call.service, call.type) == ("/asked/run", "ir_msgs/action/RunProgram")
    assert deserialize_message(bytes(call.request), RunProgram.Goal).program_id == "abc"
    assert deserialize_message(bytes(call.response), RunProgram.Result).executed == 3


def test_where_nobody_listens_nothing_is_copied(
    asked: Any, ros_executor: Any, ros_node: Any, wait_for: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    copied: list[Any] = []
    monkeypatch.setattr(calls, "serialize_message", copied.append)
    assert ask(ros_executor, ros_node, wait_for) == "hib is set"
    assert copied == []


def test_a_message_beyond_the_bound_is_left_out_before_it_is_copied(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    most = GetCell.Response(cell_yaml="x" * (MOST_BYTES - 2000))
    assert MOST_BYTES - 2000 < len(calls._bounded_cdr(most)) <= MOST_BYTES
    monkeypatch.setattr(calls, "serialize_message", lambda message: pytest.fail("it was copied"))
    assert len(calls._bounded_cdr(GetCell.Response(cell_yaml="x" * MOST_BYTES))) == 0
