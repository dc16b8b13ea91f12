"""`ir ros call`, `ir ros echo` and `ir ros list` against a real node, in the syntax of ros2cli."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from ir_cli.main import main
from ir_msgs.msg import Signal
from ir_msgs.srv import SetPlcInput
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import WaitFor

SERVICE = "/machine/set"
TOPIC = "/machine/signal"


@pytest.fixture
def ros_discovery_range() -> str:
    """The commands have a participant of their own, which has to find the machine."""
    return "SYSTEM_DEFAULT"


@pytest.fixture
def machine(
    ros_context: Context, ros_domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Node]:
    """A node with a service that says yes to "ab" and a latched topic, in the domain of the
    commands.
    """
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
    node = Node("machine", context=ros_context)

    def answer(
        request: SetPlcInput.Request, response: SetPlcInput.Response
    ) -> SetPlcInput.Response:
        known = request.name == "ab"
        response.status.code = 1 if known else -19
        response.status.message = "" if known else f"input {request.name} is unknown: known are ab"
        response.inputs.ab = request.value
        return response

    node.create_service(SetPlcInput, SERVICE, answer)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(Signal, TOPIC, latched).publish(Signal(name="door_open", value=True))
    with BackgroundExecutor(ros_context) as executor:
        executor.add_node(node)
        yield node


@pytest.mark.parametrize("typed", [[], ["ir_msgs/srv/SetPlcInput"]])
def test_call_prints_the_response_with_or_without_the_type(
    machine: Node, typed: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ros", "call", SERVICE, *typed, "{name: ab, value: true}"]) == 0
    assert "  ab: true" in capsys.readouterr().out


def test_call_ends_with_1_when_the_status_is_no_success(
    machine: Node, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ros", "call", SERVICE, "{name: door}"]) == 1
    assert "input door is unknown" in capsys.readouterr().out


def test_call_refuses_an_unknown_field_and_lists_the_known_ones(
    machine: Node, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ros", "call", SERVICE, "{bit: ab}"]) == 1
    assert 'unknown field "bit": known are name, value' in capsys.readouterr().err


def test_echo_prints_the_latched_message(machine: Node, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ros", "echo", TOPIC, "--once"]) == 0
    output = capsys.readouterr().out
    assert "name: door_open\nvalue: true\n---" in output


def test_list_shows_names_with_types(
    machine: Node, capsys: pytest.CaptureFixture[str], wait_for: WaitFor
) -> None:
    """What is there at that moment: discovery may take a busy machine longer than a graph takes to
    settle.
    """

    def listed() -> bool:
        assert main(["ros", "list", "topics"]) == 0
        return f"{TOPIC} [ir_msgs/msg/Signal]\n" in capsys.readouterr().out

    wait_for(listed, what="the topic is listed")


def test_a_typo_is_answered_with_the_name_that_was_meant(
    machine: Node, capsys: pytest.CaptureFixture[str], wait_for: WaitFor
) -> None:
    """As soon as the graph is whole: a busy machine may find half of it, and nothing more for a
    second.
    """

    def answered() -> bool:
        assert main(["ros", "call", "/machin/set", "{}"]) == 1
        return f"no service /machin/set: did you mean {SERVICE}?" in capsys.readouterr().err

    wait_for(answered, what="the name that was meant")


def test_another_type_than_the_services_is_refused_at_once(
    machine: Node, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ros", "call", SERVICE, "ir_msgs/srv/SetLoad", "{}"]) == 1
    assert f"service {SERVICE} has the type ir_msgs/srv/SetPlcInput" in capsys.readouterr().err
