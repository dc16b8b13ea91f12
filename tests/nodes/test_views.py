"""The Foxglove layout and the RViz configuration show what a cell's nodes publish, and that can be
drawn.

Form of a layout: that which Foxglove exports (configById, layout, and the panels' own settings); of
a
configuration: rviz_common's displays with the type of message that each takes.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
import yaml
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from ir_msgs_py.names import WORLD_FRAME
from ir_msgs_py.ros.messages import interface_type
from ir_planner.node.node import PlannerNode
from ir_program_runner.node import ProgramRunnerNode
from ir_recorder.recording.cell_topics import TopicSelection
from ir_sim_driver.node import SimDriver

BRINGUP = Path(__file__).resolve().parents[2] / "ros_ws" / "src" / "ir_bringup"
LAYOUT = json.loads((BRINGUP / "foxglove" / "cell.json").read_text(encoding="utf-8"))
RVIZ = yaml.safe_load((BRINGUP / "rviz" / "cell.rviz").read_text(encoding="utf-8"))
DRAWN_BY_3D = {"visualization_msgs/msg/MarkerArray"}
STAMPS = ("headerStamp", "receiveTime")
NUMBERS = re.compile(r"(u?int\d+|double|float|boolean)$")
SHOWS = {
    "rviz_default_plugins/RobotModel": "std_msgs/msg/String",
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/Grid": None,
}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def topics(ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any) -> dict[str, str]:
    """Topics of a cell's nodes with their types."""

    def made(kind: Any, **parameters: Any) -> None:
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        ros_executor.add_node(kind(context=ros_context, parameter_overrides=overrides))

    made(PlannerNode, cell="demo")
    made(SimDriver, cell="demo", backend="ideal", wake_port=0)
    made(ProgramRunnerNode)
    wait_for(
        lambda: (
            {"ir_planner", "ir_sim_driver", "ir_program_runner"} <= set(ros_node.get_node_names())
        )
    )
    return {
        name: types[0]
        for name, types in ros_node.get_topic_names_and_types()
        if ros_node.count_publishers(name)
    }


def field_type(type_name: str, path: list[str]) -> str:
    """Type of a field below a message, as IDL names it; KeyError for one that isn't there."""
    for step in path:
        name, _, index = step.partition("[")
        type_name = interface_type(type_name, "msg").get_fields_and_field_types()[name]
        if index:
            found = re.fullmatch(r"(?:sequence<([^,>]+).*>|(.+)\[\d+\])", type_name)
            assert found, f"{step} is no sequence"
            type_name = found[1] or found[2]
        if "/" in type_name:
            type_name = type_name.replace("/", "/msg/")
    return type_name


def panels() -> Iterator[tuple[str, dict[str, Any]]]:
    """Type and settings of each panel of the layout."""
    for name, settings in LAYOUT["configById"].items():
        yield name.partition("!")[0], settings


def placed(node: Any) -> Iterator[str]:
    """Panels of the layout's tree; each fork has a direction and two sides."""
    if isinstance(node, str):
        yield node
        return
    assert node["direction"] in ("row", "column")
    assert 0 < node["splitPercentage"] < 100
    for side in ("first", "second"):
        yield from placed(node[side])


def test_the_layout_places_every_panel_once() -> None:
    assert set(LAYOUT) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(placed(LAYOUT["layout"])) == sorted(LAYOUT["configById"])
    kinds = {kind for kind, _ in panels()}
    assert kinds == {"3D", "Plot", "StateTransitions", "DiagnosticSummary"}


def test_both_views_show_what_the_nodes_publish_and_recordings_hold(topics: dict[str, str]) -> None:
    shown = set()
    for kind, settings in panels():
        for topic in settings.get("topics", ()):
            shown.add(topic)
            assert topics[topic] in DRAWN_BY_3D
        for path in settings.get("paths", ()):
            topic, *fields = path["value"].split(".")
            shown.add(topic)
            found = field_type(topics[topic], fields)
            assert NUMBERS.match(found) or (kind == "StateTransitions" and found == "string"), path
            assert path["timestampMethod"] in STAMPS
            if path["timestampMethod"] == "headerStamp":
                assert field_type(topics[topic], ["header"]) == "std_msgs/msg/Header"
        if kind == "DiagnosticSummary":
            assert topics[settings["topicToRender"]] == "diagnostic_msgs/msg/DiagnosticArray"
        if kind == "3D":
            assert settings["followTf"] == WORLD_FRAME
            assert {layer["layerId"] for layer in settings["layers"].values()} == {"foxglove.Grid"}
    for display in RVIZ["Visualization Manager"]["Displays"]:
        wanted = SHOWS[display["Class"]]
        place = display.get("Topic") or display.get("Description Topic")
        assert (place is None) == (wanted is None)
        if place is not None:
            shown.add(f"/{place['Value']}")
            assert topics[f"/{place['Value']}"] == wanted
    assert RVIZ["Visualization Manager"]["Global Options"]["Fixed Frame"] == WORLD_FRAME
    selection = TopicSelection()
    assert {topic for topic in shown if topic not in selection} == set()
    for needed in ("power_state", "robot_markers", "markers", "plc_outputs", "program_state"):
        assert any(topic.endswith(needed) for topic in shown)


def test_rviz_asks_for_no_more_than_is_offered(topics: dict[str, str], ros_node: Any) -> None:
    for display in RVIZ["Visualization Manager"]["Displays"]:
        place = display.get("Topic") or display.get("Description Topic")
        if place is None:
            continue
        for publisher in ros_node.get_publishers_info_by_topic(f"/{place['Value']}"):
            offered = publisher.qos_profile.durability
            if place["Durability Policy"] == "Transient Local":
                assert offered == DurabilityPolicy.TRANSIENT_LOCAL, place


def test_robot_and_cell_can_be_drawn(
    topics: dict[str, str], ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    heard: dict[str, Any] = {}
    for topic, kind in (
        ("/ir_planner/markers", MarkerArray),
        ("/ir_sim_driver/robot_markers", MarkerArray),
        ("/robot_description", String),
    ):

        def take(message: Any, topic: str = topic) -> None:
            heard[topic] = message

        qos = QoSProfile(depth=1) if "robot_markers" in topic else LATCHED
        ros_executor.run(
            lambda k=kind, t=topic, c=take, q=qos: ros_node.create_subscription(k, t, c, q)
        )
    wait_for(lambda: len(heard) == 3, what="markers of cell and robot, and the URDF")
    for topic in ("/ir_planner/markers", "/ir_sim_driver/robot_markers"):
        markers = [m for m in heard[topic].markers if m.action == Marker.ADD]
        assert len(markers) > 10
        assert len({(m.ns, m.id) for m in markers}) == len(markers)
        for marker in markers:
            check_drawable(marker)
    root = Xml.fromstring(heard["/robot_description"].data)
    links = {x.get("name") for x in root.iter("link")}
    children = {x.get("link") for x in root.iter("child")}
    assert links - children == {WORLD_FRAME}


def check_drawable(marker: Any) -> None:
    """What RViz and Foxglove ask of a marker: a frame, a rotation, a size, a colour that is
    seen.
    """
    turn = marker.pose.orientation
    size = marker.scale
    assert marker.header.frame_id == WORLD_FRAME
    assert math.hypot(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1.0, abs=1e-6)
    assert marker.color.a > 0.0 or (marker.colors and all(c.a > 0.0 for c in marker.colors))
    if marker.type in (Marker.LINE_STRIP, Marker.LINE_LIST):
        assert size.x > 0.0
        assert len(marker.points) >= 2
    elif marker.type == Marker.TEXT_VIEW_FACING:
        assert size.z > 0.0
        assert marker.text
    else:
        assert min(size.x, size.y, size.z) > 0.0
    if marker.type == Marker.TRIANGLE_LIST:
        assert len(marker.points) % 3 == 0
        assert marker.points
