"""Names of a node that was started under another name, and the events of its services."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from rclpy.action.graph import get_action_names_and_types
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from service_msgs.msg import ServiceEventInfo

from ir_msgs.srv import GetCell, SetPlcInput
from ir_msgs_py.ros.parameters import introspect_services
from ir_planner.node.node import PlannerNode
from ir_program_runner.node import ProgramRunnerNode
from ir_recorder.node.recorder import RecorderNode
from ir_sim_driver.node import SimDriver
from ir_studies.node import StudiesNode

PAGE = Path(__file__).resolve().parents[2] / "docs" / "interfaces.md"
NODES = {
    "ir_planner": (PlannerNode, {"cell": "open"}),
    "ir_sim_driver": (SimDriver, {"cell": "open", "backend": "ideal", "wake_port": 0}),
    "ir_program_runner": (ProgramRunnerNode, {}),
    "ir_recorder": (RecorderNode, {}),
    "ir_studies": (StudiesNode, {}),
}


def documented(node: str) -> set[str]:
    """Names after `~/` in the rows of the node's section, control_msgs' excepted."""
    section = PAGE.read_text().partition(f"\n## {node}\n")[2].partition("\n## ")[0]
    rows = [
        row for row in section.splitlines() if row.startswith("|") and "control_msgs" not in row
    ]
    return {name for row in rows for name in re.findall(r"`~/(\w+)`", row.split("|")[1])}


@pytest.fixture
def start(ros_context, ros_executor):
    def make(name, *words, **parameters):
        kind, given = NODES[name]
        overrides = [Parameter(key, value=value) for key, value in {**given, **parameters}.items()]
        arguments = ["--ros-args", *words]
        return ros_executor.add_node(
            kind(context=ros_context, cli_args=arguments, parameter_overrides=overrides)
        )

    return make


@pytest.mark.parametrize("name", NODES)
def test_every_private_name_of_the_page_moves_with_the_node(start, name):
    node = start(name, "-r", "__node:=other", "-r", "__ns:=/cell_1")
    known = {found for found, _ in node.get_topic_names_and_types()}
    known |= {found for found, _ in node.get_service_names_and_types()}
    known |= {found for found, _ in get_action_names_and_types(node)}
    wanted = documented(name)
    assert wanted, name
    assert {f"/cell_1/other/{each}" for each in wanted} <= known
    served = {found for found, _ in node.get_service_names_and_types_by_node("other", "/cell_1")}
    assert not [found for found in served if f"/{name}/" in found]


@pytest.mark.parametrize(
    ("name", "kind", "leaf"),
    [("ir_planner", GetCell, "get_cell"), ("ir_sim_driver", SetPlcInput, "set_plc_input")],
)
@pytest.mark.parametrize("chosen", ["metadata", "contents"])
def test_events_of_a_service_are_published_as_the_parameter_says(
    start, ros_node, ros_executor, wait_for, name, kind, leaf, chosen
):
    node = start(name, service_introspection=chosen)
    ros_executor.run(lambda: introspect_services(node))
    assert node.get_parameter("service_introspection").value == chosen
    events = []
    topic = f"/{name}/{leaf}/_service_event"
    ros_executor.run(
        lambda: ros_node.create_subscription(kind.Event, topic, events.append, QoSProfile(depth=10))
    )
    client = ros_executor.run(lambda: ros_node.create_client(kind, f"/{name}/{leaf}"))
    wait_for(client.service_is_ready, what=f"{leaf} is offered")
    wait_for(lambda: ros_node.count_publishers(topic), what="the events are offered")
    future = ros_executor.run(lambda: client.call_async(kind.Request()))
    wait_for(future.done, what=f"{leaf} answers")
    wait_for(lambda: len(events) >= 2, what="both events")
    kinds = {event.info.event_type: event for event in events}
    assert set(kinds) == {ServiceEventInfo.REQUEST_RECEIVED, ServiceEventInfo.RESPONSE_SENT}
    answer = kinds[ServiceEventInfo.RESPONSE_SENT].response
    assert list(answer) == ([future.result()] if chosen == "contents" else [])


def test_without_the_parameter_nothing_is_published(start, ros_executor):
    node = start("ir_planner")
    ros_executor.run(lambda: introspect_services(node))
    assert not [name for name, _ in node.get_topic_names_and_types() if "_service_event" in name]
