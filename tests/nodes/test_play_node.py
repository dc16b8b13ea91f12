"""A recording played into the graph arrives byte by byte, latched where it was latched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64, String

from ir_recorder.format.qos import QosOffer
from ir_recorder.play.node import PlayNode
from ir_recorder.play.schedule import PlaySettings
from ir_recorder.read.raw import read_raw
from ir_recorder.write.session import RecordingSession
from ir_recorder.write.writer import RecordingWriter

START = 1_700_000_000_000_000_000


def recorded(path: Path) -> Any:
    session = RecordingSession(RecordingWriter(path), {}, START)
    session.open_topic("/value", "std_msgs/msg/Float64", [QosOffer()])
    session.open_topic("/text", "std_msgs/msg/String", [QosOffer(transient_local=True)])
    session.message("/text", serialize_message(String(data="latched")), START)
    for k in range(20):
        session.message("/value", serialize_message(Float64(data=float(k))), START + k * 5_000_000)
    return read_raw(session.finish().path)


def test_messages_arrive_in_order_and_latched_ones_later_too(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any, tmp_path: Path
) -> None:
    values: list[float] = []
    ticks: list[int] = []
    texts: list[str] = []
    ros_node.create_subscription(Float64, "/value", lambda m: values.append(m.data), 100)
    ros_node.create_subscription(Clock, "/clock", lambda m: ticks.append(m.clock.sec), 100)
    player = PlayNode(
        recorded(tmp_path / "a.mcap"), PlaySettings(), clock=True, delay=0.2, context=ros_context
    )
    ros_executor.add_node(player)
    wait_for(lambda: ros_node.count_publishers("/value"))
    player.start()
    wait_for(lambda: len(values) == 20)
    assert values == [float(k) for k in range(20)]
    wait_for(lambda: ticks)
    assert ticks[0] == START // 10**9
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    ros_node.create_subscription(String, "/text", lambda m: texts.append(m.data), latched)
    wait_for(lambda: texts == ["latched"])
    player.stop()


def test_a_loop_ends_when_it_is_asked_to(
    ros_context: Any, ros_executor: Any, wait_for: Any, tmp_path: Path
) -> None:
    player = PlayNode(
        recorded(tmp_path / "a.mcap"), PlaySettings(rate=50.0, loop=True), delay=0.0, context=ros_context
    )
    ros_executor.add_node(player)
    player.start()
    wait_for(lambda: player.playing)
    player.stop()
    assert not player.playing
    assert player.published > 0
