"""The SROS 2 policy: of the form that its schema asks for, and no more or less than what the nodes
open.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
from rclpy.action.graph import (
    get_action_client_names_and_types_by_node,
    get_action_server_names_and_types_by_node,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from ir_msgs_py.names import hidden_node
from ir_planner.node.node import PlannerNode
from ir_program_runner.node import ProgramRunnerNode
from ir_recorder.live.node import LiveNode
from ir_recorder.node.recorder import RecorderNode
from ir_recorder.recording.cell_topics import TopicSelection
from ir_sim_driver.node import SimDriver
from ir_studies.node import StudiesNode

ROOT = Path(__file__).resolve().parents[2]
# elements of a policy 0.2.0 with their attributes and children, from the schema of ros2/sros2
ELEMENTS = {
    "policy": ({"version"}, {"enclaves"}),
    "enclaves": (set(), {"enclave"}),
    "enclave": ({"path"}, {"profiles"}),
    "profiles": (set(), {"profile"}),
    "profile": ({"ns", "node"}, {"topics", "services", "actions"}),
}
RIGHTS = {
    "topics": {"publish", "subscribe"},
    "services": {"reply", "request"},
    "actions": {"call", "execute"},
}
NOT_OPEN_HERE = {
    "/clock",  # only where time is scaled or simulated
    "/tf",  # only where tf2_msgs is installed
    "/tf_static",
    "/ir_sim_driver/follow_joint_trajectory",  # only where control_msgs is installed
}


@pytest.fixture(scope="module")
def tool() -> Any:
    spec = importlib.util.spec_from_file_location(
        "security_policy", ROOT / "tools" / "security_policy.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["security_policy"] = module
    spec.loader.exec_module(module)
    return module


def check_form(element: Xml.Element) -> None:
    """Raise AssertionError where the schema does not allow the element, its attributes or its
    children.
    """
    if element.tag in RIGHTS:
        assert element.attrib
        assert set(element.attrib) <= RIGHTS[element.tag]
        assert set(element.attrib.values()) <= {"ALLOW", "DENY"}
        assert {child.tag for child in element} == {element.tag.removesuffix("s")}
        assert all(child.text and not child.attrib and not len(child) for child in element)
        return
    attributes, children = ELEMENTS[element.tag]
    assert set(element.attrib) == attributes
    assert len(element)
    assert {child.tag for child in element} <= children
    for child in element:
        check_form(child)


def test_the_installed_policy_is_what_the_names_say_and_has_the_form_of_the_schema(
    tool: Any,
) -> None:
    text = tool.FILE.read_text(encoding="utf-8")
    assert text == tool.policy()
    for policy in (text, tool.policy("/cell_1")):
        root = Xml.fromstring(policy)
        assert root.tag == "policy"
        check_form(root)
    assert {profile.get("ns") for profile in root.iter("profile")} == {"/cell_1"}


@pytest.fixture
def ros_discovery_range() -> str:
    """The driver's other participants are found."""
    return "SYSTEM_DEFAULT"


@pytest.fixture
def nodes(ros_context: Any, ros_executor: Any) -> dict[str, Any]:
    def made(kind: Any, **parameters: Any) -> Any:
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        return ros_executor.add_node(kind(context=ros_context, parameter_overrides=overrides))

    return {
        "ir_planner": made(PlannerNode),
        "ir_sim_driver": made(SimDriver, cell="open", backend="ideal", wake_port=0),
        "ir_program_runner": made(ProgramRunnerNode),
        "ir_recorder": made(RecorderNode),
        "ir_studies": made(StudiesNode),
        "ir_live": made(LiveNode),
    }


OPENED = {
    "publish": Node.get_publisher_names_and_types_by_node,
    "subscribe": Node.get_subscriber_names_and_types_by_node,
    "reply": Node.get_service_names_and_types_by_node,
    "request": Node.get_client_names_and_types_by_node,
    "execute": get_action_server_names_and_types_by_node,
    "call": get_action_client_names_and_types_by_node,
}


def of_no_action(found: list[tuple[str, list[str]]]) -> set[str]:
    return {name for name, _ in found if "/_action/" not in name}


def absolute(names: tuple[str, ...]) -> set[str]:
    return {name if name.startswith("/") else f"/{name}" for name in names}


def test_each_node_may_do_what_it_does_and_nothing_else(
    tool: Any, nodes: Any, ros_node: Any, wait_for: Any
) -> None:
    look = ros_node
    hidden = {hidden_node("ir_sim_driver", what) for what in ("presses", "requests")}
    wait_for(lambda: set(nodes) | hidden <= set(look.get_node_names()))
    for name, rights in tool.rights().items():
        if name == tool.OPERATOR:
            continue
        own = [node for node in look.get_node_names() if node.removeprefix("_").startswith(name)]
        opened = {
            right: {each for node in own for each in of_no_action(found(look, node, "/"))}
            for right, found in OPENED.items()
        }
        for right, names in opened.items():
            allowed = absolute(getattr(rights, right))
            assert names <= allowed, (name, right)
            if (name, right) == ("ir_recorder", "subscribe"):  # it records nothing now
                continue
            common = {"/parameter_events"} if right == "subscribe" else set()
            assert allowed - names <= NOT_OPEN_HERE | common, (name, right)


def test_the_recorder_may_hear_all_that_it_records(tool: Any) -> None:
    rights = tool.rights()
    heard = absolute(rights["ir_recorder"].subscribe)
    published = {topic for own in rights.values() for topic in absolute(own.publish)} - {"/clock"}
    assert {topic for topic in published if topic in TopicSelection()} <= heard
