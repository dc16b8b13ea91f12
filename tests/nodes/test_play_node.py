"""A recording played into the graph arrives byte by byte, latched where it was latched."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64, String

from ir_msgs_py import names
from ir_msgs_py.ros.messages import interface_type
from ir_planner.node.node import PlannerNode
from ir_program_runner.node import ProgramRunnerNode
from ir_recorder.errors import RecorderError
from ir_recorder.format.qos import QosOffer
from ir_recorder.play.node import PlayNode
from ir_recorder.play.playback import PlaySettings, is_command
from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter
from ir_sim_driver.node import SimDriver

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


def test_a_time_that_clock_can_t_say_is_refused(ros_context: Any, tmp_path: Path) -> None:
    session = RecordingSession(RecordingWriter(tmp_path / "far.mcap"), {}, START)
    session.open_topic("/value", "std_msgs/msg/Float64", [QosOffer()])
    session.message("/value", serialize_message(Float64()), 2**62)
    far = read_raw(session.finish().path)
    with pytest.raises(RecorderError, match="which /clock can't say"):
        PlayNode(far, PlaySettings(), clock=True, context=ros_context)


def test_playback_that_fails_says_so(
    ros_context: Any, wait_for: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    player = PlayNode(recorded(tmp_path / "a.mcap"), PlaySettings(), delay=0.0, context=ros_context)

    def publish(message: object) -> None:
        raise OverflowError("timestamp too large")

    monkeypatch.setattr(player, "_publish", publish)
    player.start()
    wait_for(lambda: not player.playing)
    assert "timestamp too large" in player.failure
    player.destroy_node()


def test_a_loop_ends_when_it_is_asked_to(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any, tmp_path: Path
) -> None:
    heard: list[Any] = []
    ros_node.create_subscription(Float64, "/value", heard.append, 100)
    player = PlayNode(
        recorded(tmp_path / "a.mcap"),
        PlaySettings(rate=50.0, loop=True),
        delay=0.0,
        context=ros_context,
    )
    ros_executor.add_node(player)
    player.start()
    wait_for(lambda: len(heard) > 20, what="it plays again")
    assert player.playing
    player.stop()
    assert not player.playing
    assert player.published >= len(heard)


def with_commands(path: Path) -> Any:
    session = RecordingSession(RecordingWriter(path), {}, START)
    for topic in ("/ir_sim_driver/speed_scaling", "/value"):
        session.open_topic(topic, "std_msgs/msg/Float64", [QosOffer()])
        for k in range(5):
            session.message(topic, serialize_message(Float64(data=float(k))), START + k * 1_000_000)
    return read_raw(session.finish().path)


def test_commands_are_left_out_unless_they_are_named(
    ros_context: Any, ros_executor: Any, wait_for: Any, tmp_path: Path
) -> None:
    recording = with_commands(tmp_path / "a.mcap")
    for topics, count in (
        ((), 5),
        (("/ir_sim_driver/*",), 0),
        (("/ir_sim_driver/speed_scaling",), 5),
    ):
        player = PlayNode(recording, PlaySettings(topics=topics), delay=0.0, context=ros_context)
        player.start()
        wait_for(lambda player=player: not player.playing)
        assert player.published == count
        assert player.failure == ""
        player.destroy_node()


def test_no_command_is_played_beside_a_driver(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any, tmp_path: Path
) -> None:
    topic = "/ir_sim_driver/speed_scaling"
    moved: list[float] = []
    ros_node.create_subscription(Float64, topic, lambda m: moved.append(m.data), 100)
    settings = PlaySettings(topics=(topic,))
    player = PlayNode(with_commands(tmp_path / "a.mcap"), settings, delay=0.3, context=ros_context)
    ros_executor.add_node(player)
    wait_for(lambda: player.count_subscribers(topic))
    player.start()
    wait_for(lambda: not player.playing)
    assert "is not played to a live robot" in player.failure
    assert ros_node.get_name() in player.failure
    assert moved == []


def test_no_command_is_played_beside_a_driver_that_does_not_listen_yet(
    ros_context: Any, ros_executor: Any, wait_for: Any, tmp_path: Path
) -> None:
    ros_executor.add_node(Node(names.SIM_DRIVER, context=ros_context))
    settings = PlaySettings(topics=("/ir_sim_driver/speed_scaling",))
    player = PlayNode(with_commands(tmp_path / "a.mcap"), settings, delay=0.0, context=ros_context)
    ros_executor.add_node(player)
    wait_for(lambda: names.SIM_DRIVER in player.get_node_names())
    player.start()
    wait_for(lambda: not player.playing)
    assert "is not played to a live robot" in player.failure
    assert player.published == 0


def test_a_driver_that_comes_later_ends_playback(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any, tmp_path: Path
) -> None:
    topic = "/ir_sim_driver/speed_scaling"
    settings = PlaySettings(rate=0.05, loop=True, topics=(topic,))
    player = PlayNode(with_commands(tmp_path / "a.mcap"), settings, delay=0.0, context=ros_context)
    ros_executor.add_node(player)
    player.start()
    wait_for(lambda: player.playing)
    ros_node.create_subscription(Float64, topic, lambda m: None, 100)
    wait_for(lambda: not player.playing)
    assert "would command" in player.failure


FREE = "/seen_by_nobody"


def of_every_topic(node: Node, others: list[Node], path: Path) -> tuple[Any, set[str]]:
    """A recording of every topic that the nodes take in or publish, as the graph has them, and
    of one more.
    """
    topics: dict[str, str] = {}
    for other in others:
        where = other.get_name(), other.get_namespace()
        for ask in (
            node.get_subscriber_names_and_types_by_node,
            node.get_publisher_names_and_types_by_node,
        ):
            topics.update({topic: types[0] for topic, types in ask(*where) if "/msg/" in types[0]})
    session = RecordingSession(RecordingWriter(path), {}, START)
    for topic, type_name in {**topics, FREE: "std_msgs/msg/String"}.items():
        session.open_topic(topic, type_name, [QosOffer(transient_local=True)])
        session.message(topic, serialize_message(interface_type(type_name, "msg")()), START)
    return read_raw(session.finish().path), set(topics)


def test_no_topic_that_a_running_node_takes_in_or_publishes_is_played_beside_it(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any, tmp_path: Path
) -> None:
    driver = SimDriver(
        context=ros_context,
        parameter_overrides=[
            Parameter("cell", value="open"),
            Parameter("backend", value="ideal"),
            Parameter("wake_port", value=0),
        ],
    )
    planner = PlannerNode(
        context=ros_context, parameter_overrides=[Parameter("cell", value="open")]
    )
    runner = ProgramRunnerNode(context=ros_context)
    others: list[Node] = [driver, planner, runner]
    for other in others:
        ros_executor.add_node(other)
    wait_for(lambda: {other.get_name() for other in others} <= set(ros_node.get_node_names()))
    recording, topics = of_every_topic(ros_node, others, tmp_path / "a.mcap")
    assert {"/ir_planner/cell", "/joint_states", "/ir_sim_driver/stop_number"} <= topics
    reported = tuple(topic for topic in topics if not is_command(topic))
    for chosen, count in (((), 1), ((*topics, FREE), 0), (reported, 0), ((*reported, FREE), 1)):
        player = PlayNode(recording, PlaySettings(topics=chosen), delay=0.0, context=ros_context)
        player.start()
        wait_for(lambda player=player: not player.playing)
        assert player.published == count
        assert bool(player.failure) == (count == 0)
        player.destroy_node()


def test_a_type_name_from_a_file_imports_nothing(
    ros_context: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "stranger").mkdir()
    (tmp_path / "stranger" / "__init__.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')")
    (tmp_path / "stranger" / "msg.py").write_text("class Thing: pass")
    monkeypatch.syspath_prepend(str(tmp_path))
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "stranger")
        for name in (
            "stranger/msg/Thing",
            "stranger.msg/msg/Thing",
            "../stranger/msg/Thing",
            "os/msg/system",
        ):
            schema = writer.register_schema(name, "ros2msg", b"int8 x")
            channel = writer.register_channel(f"/t{schema}", "cdr", schema)
            writer.add_message(channel, 1, b"\0\1\0\0\1", 1)
        writer.finish()
    player = PlayNode(read_raw(path), PlaySettings(), delay=0.0, context=ros_context)
    player.destroy_node()
    assert not (tmp_path / "ran").exists()
    assert "stranger" not in sys.modules
