"""The recorder node on real topics, in one process."""

from __future__ import annotations

import gc
import os
import resource
import signal
import subprocess
import sys
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log, ParameterEvent
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from ir_msgs.msg import PowerState
from ir_msgs.srv import GetCell, StartRecording, StopRecording
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_recorder.errors import ReadError, RecorderError, WriteError
from ir_recorder.node.recorder import COMMAND_NODE, POLL_PERIOD, RecorderNode
from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.recording.cell_topics import GLOBAL
from ir_recorder.recording.settings import RecorderSettings
from ir_recorder.recording.worker import FLUSH_PERIOD
from ir_recorder.recording.writer import RecordingWriter

LATCHED = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


@pytest.fixture
def settings(tmp_path: Path) -> RecorderSettings:
    return RecorderSettings(discovery_period=0.01, roots=(str(tmp_path),))


@pytest.fixture
def recorder(ros_context: Any, ros_executor: Any, settings: RecorderSettings) -> RecorderNode:
    return ros_executor.add_node(RecorderNode(settings, context=ros_context))


@pytest.fixture
def call(ros_node: Any, ros_executor: Any, wait_for: Any) -> Any:
    def send(kind: Any, name: str, request: Any) -> Any:
        client = ros_node.create_client(kind, name)
        wait_for(client.service_is_ready)
        future = client.call_async(request)
        wait_for(future.done, what=f"{name} answers")
        return future.result()

    return send


def start(call: Any, path: Path, **fields: Any) -> Any:
    request = StartRecording.Request(path=str(path), **fields)
    return call(StartRecording, "/ir_recorder/start", request)


def stop(call: Any) -> Any:
    return call(StopRecording, "/ir_recorder/stop", StopRecording.Request())


def so_far(path: Path, topic: str) -> tuple[bytes, ...]:
    """Messages of a topic that the file of a running recording holds."""
    try:
        channel = read_raw(path).channel(topic)
    except ReadError:  # nothing yet
        return ()
    return channel.messages if channel is not None else ()


def test_latched_and_volatile_messages_arrive_byte_by_byte(
    recorder: RecorderNode, ros_node: Any, call: Any, wait_for: Any, tmp_path: Path
) -> None:
    description = ros_node.create_publisher(String, "/robot_description", LATCHED)
    description.publish(String(data="<robot/>"))
    joints = ros_node.create_publisher(JointState, "/joint_states", 100)
    started = start(call, tmp_path / "a.mcap", topics=["/robot_description", "joint_states"])
    assert started.status.code == StatusCode.SUCCESS
    wait_for(lambda: joints.get_subscription_count() and description.get_subscription_count())
    for k in range(500):
        message = JointState(name=["joint_a1"], position=[float(k)])
        joints.publish(message)
    wait_for(lambda: recorder.messages == 501)
    stopped = stop(call)
    assert stopped.status.code == StatusCode.SUCCESS
    assert stopped.path == str(tmp_path / "a.mcap")
    raw = read_raw(tmp_path / "a.mcap")
    assert raw.problems == ()
    messages = [deserialize_message(m, JointState) for m in raw.channel("/joint_states").messages]
    positions = [message.position[0] for message in messages]
    assert positions == list(range(500))
    assert b"<robot/>" in raw.channel("/robot_description").messages[0]
    assert "transient_local" in raw.channel("/robot_description").qos


def test_topics_of_the_nodes_are_recorded_and_others_are_not(
    recorder: RecorderNode, ros_node: Any, call: Any, wait_for: Any, tmp_path: Path
) -> None:
    ours = ros_node.create_publisher(Float64, "/ir_sim_driver/speed_scaling", 10)
    other = ros_node.create_publisher(Float64, "/elsewhere", 10)
    late_joiner = None
    start(call, tmp_path / "b.mcap")
    wait_for(ours.get_subscription_count)
    late_joiner = ros_node.create_publisher(Float64, "/ir_planner/late", 10)
    wait_for(late_joiner.get_subscription_count)
    assert other.get_subscription_count() == 0
    stop(call)


def test_only_the_recorders_own_cell_is_recorded(
    ros_context: Any,
    ros_executor: Any,
    settings: RecorderSettings,
    ros_node: Any,
    wait_for: Any,
    tmp_path: Path,
) -> None:
    recorder = ros_executor.add_node(
        RecorderNode(settings, context=ros_context, namespace="cell_1")
    )
    ros_executor.run(lambda: recorder.start(str(tmp_path / "own.mcap")))
    diagnostics = ros_node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    rosout = ros_node.create_publisher(Log, "/rosout", LATCHED)
    events = ros_node.create_publisher(ParameterEvent, "/parameter_events", 10)
    states = {
        cell: ros_node.create_publisher(PowerState, f"{cell}/ir_sim_driver/power_state", 10)
        for cell in ("", "/cell_1", "/cell_10")
    }
    wait_for(states["/cell_1"].get_subscription_count)
    for publisher in (diagnostics, rosout, events):
        wait_for(lambda publisher=publisher: publisher.get_subscription_count())
    for cell, state in states.items():
        status = DiagnosticStatus(name=f"{cell}/ir_sim_driver: plant".strip("/"))
        diagnostics.publish(DiagnosticArray(status=[status]))
        rosout.publish(Log(name=f"{cell}/ir_planner".strip("/").replace("/", "."), msg="hello"))
        events.publish(ParameterEvent(node=f"{cell}/ir_planner"))
        state.publish(PowerState())
    rosout.publish(Log(name="cell_1.ir_planner", msg="last"))

    def own_have_come() -> bool:
        """The last word, and of each other topic the cell's own message, which comes when it
        likes.
        """
        ends = {"/rosout": b"last", "/diagnostics": b"cell_1/", "/parameter_events": b"/cell_1/"}
        return all(
            any(end in message for message in so_far(tmp_path / "own.mcap", topic))
            for topic, end in ends.items()
        )

    wait_for(own_have_come)
    ros_executor.run(recorder.finish)
    raw = read_raw(tmp_path / "own.mcap")
    assert all(c.topic.startswith("/cell_1/") or c.topic in GLOBAL for c in raw.channels)
    said = [deserialize_message(m, DiagnosticArray) for m in raw.channel("/diagnostics").messages]
    assert {s.name.partition("/")[0] for message in said for s in message.status} == {"cell_1"}
    logs = [deserialize_message(m, Log).name for m in raw.channel("/rosout").messages]
    assert {name.partition(".")[0] for name in logs} == {"cell_1"}
    nodes = [
        deserialize_message(m, ParameterEvent).node
        for m in raw.channel("/parameter_events").messages
    ]
    assert {name.split("/")[1] for name in nodes} == {"cell_1"}


def test_a_recording_goes_on_in_further_files(
    recorder: RecorderNode, ros_node: Any, call: Any, wait_for: Any, tmp_path: Path
) -> None:
    refused = start(call, tmp_path / "s.mcap", split_size=10)
    assert "split_size is 10 bytes" in refused.status.message
    talker = ros_node.create_publisher(String, "/ir_planner/long", 100)
    assert start(call, tmp_path / "s.mcap", split_size=1_000_000).status.code == StatusCode.SUCCESS
    wait_for(talker.get_subscription_count)
    texts = [np.random.default_rng(k).bytes(50_000).hex() for k in range(50)]
    for text in texts:
        talker.publish(String(data=text))
    wait_for(lambda: recorder.messages >= 50)
    stopped = stop(call)
    assert stopped.paths[0] == stopped.path == str(tmp_path / "s.mcap")
    assert stopped.paths[1] == str(tmp_path / "s_1.mcap")
    assert stopped.dropped == 0
    found = read_raw(tmp_path / "s.mcap").channel("/ir_planner/long").messages
    assert [deserialize_message(data, String).data for data in found] == texts


def test_a_slow_message_reaches_the_disk_within_a_second(
    recorder: RecorderNode, ros_node: Any, call: Any, wait_for: Any, tmp_path: Path
) -> None:
    slow = ros_node.create_publisher(String, "/ir_planner/slow", 10)
    start(call, tmp_path / "slow.mcap", topics=["/ir_planner/slow"])
    wait_for(slow.get_subscription_count)
    slow.publish(String(data="once"))
    wait_for(lambda: recorder.messages == 1)
    wait_for(lambda: so_far(tmp_path / "slow.mcap", "/ir_planner/slow"))
    assert FLUSH_PERIOD + POLL_PERIOD < 1.0  # a figure of the clock is no test on a busy machine
    stop(call)


def test_patterns_choose_other_topics(
    recorder: RecorderNode, ros_node: Any, call: Any, wait_for: Any, tmp_path: Path
) -> None:
    other = ros_node.create_publisher(Float64, "/elsewhere/value", 10)
    joints = ros_node.create_publisher(JointState, "/joint_states", 10)
    start(call, tmp_path / "c.mcap", topics=["/elsewhere/*"])
    wait_for(other.get_subscription_count)
    assert joints.get_subscription_count() == 0
    stop(call)


def test_wanted_topics_that_nobody_publishes_are_named_and_recorded_when_they_come(
    recorder: RecorderNode, ros_node: Any, call: Any, wait_for: Any, tmp_path: Path
) -> None:
    here = ros_node.create_publisher(Float64, "/here", 10)
    wait_for(lambda: ("/here", ["std_msgs/msg/Float64"]) in recorder.get_topic_names_and_types())
    wanted = ["/here", "late", "/elsewhere/*"]
    started = start(call, tmp_path / "wanted.mcap", topics=wanted)
    assert started.status.code == StatusCode.SUCCESS
    assert started.status.message.endswith("no publisher is seen yet of /late, /elsewhere/*")
    wait_for(here.get_subscription_count)
    late = ros_node.create_publisher(Float64, "/late", 10)
    wait_for(late.get_subscription_count)
    stopped = stop(call)
    assert stopped.status.code == StatusCode.SUCCESS
    assert stopped.status.message.endswith("no publisher was seen of /elsewhere/*")


def test_a_missing_directory_is_named_and_not_made(
    recorder: RecorderNode, call: Any, tmp_path: Path
) -> None:
    refused = start(call, tmp_path / "no" / "such" / "a.mcap")
    assert refused.status.code == StatusCode.FAILURE
    assert f"there is no directory {tmp_path / 'no' / 'such'}" in refused.status.message
    assert list(tmp_path.iterdir()) == []
    assert start(call, tmp_path / "a.mcap").status.code == StatusCode.SUCCESS


def test_a_taken_path_is_refused_and_the_node_lives_on(
    recorder: RecorderNode, call: Any, tmp_path: Path
) -> None:
    taken = RecordingWriter(tmp_path / "taken.mcap").finish().path
    before = taken.read_bytes()
    refused = start(call, taken)
    assert refused.status.code == StatusCode.FAILURE
    assert "taken.mcap is there already" in refused.status.message
    assert taken.read_bytes() == before
    assert start(call, taken, overwrite=True).status.code == StatusCode.SUCCESS


def test_a_request_writes_only_below_the_roots_and_replaces_only_recordings(
    recorder: RecorderNode, call: Any, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    outside = tmp_path_factory.mktemp("outside")
    (tmp_path / "link").symlink_to(outside)
    notes = tmp_path / "notes.mcap"
    notes.write_text("my only copy")
    for path, sentence in (
        (outside / "a.mcap", "lies outside of the folders"),
        (tmp_path / "link" / "a.mcap", "lies outside of the folders"),
        (notes, "another kind"),
    ):
        refused = start(call, path, overwrite=True)
        assert refused.status.code == StatusCode.FAILURE
        assert sentence in refused.status.message
    assert list(outside.iterdir()) == []
    assert notes.read_text() == "my only copy"


def test_parameters_of_the_nodes_are_attached(
    recorder: RecorderNode,
    ros_context: Any,
    ros_executor: Any,
    call: Any,
    wait_for: Any,
    tmp_path: Path,
) -> None:
    planner = Node("ir_planner", context=ros_context)
    planner.declare_parameter("safety_distance", 0.031)
    planner.declare_parameter("names", ["a", "b"])
    ros_executor.add_node(planner)
    start(call, tmp_path / "p.mcap", topics=["/nothing"])
    wait_for(lambda: recorder.attached("ir_planner.parameters.yaml"))
    stop(call)
    text = read_raw(tmp_path / "p.mcap").attachment("ir_planner.parameters.yaml")
    values = yaml.safe_load(text)["/ir_planner"]["ros__parameters"]
    assert values["safety_distance"] == 0.031
    assert values["names"] == ["a", "b"]


def test_a_second_start_names_the_running_recording(
    recorder: RecorderNode, call: Any, tmp_path: Path
) -> None:
    start(call, tmp_path / "first.mcap")
    second = start(call, tmp_path / "second.mcap")
    assert second.status.code == StatusCode.FAILURE
    assert "first.mcap" in second.status.message
    assert not (tmp_path / "second.mcap").exists()


def test_stop_without_a_recording_says_so(recorder: RecorderNode, call: Any) -> None:
    answer = stop(call)
    assert answer.status.code == StatusCode.FAILURE
    assert answer.status.message == "nothing is being recorded"


def test_a_full_disk_ends_the_recording_and_nothing_else(
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    call: Any,
    wait_for: Any,
    tmp_path: Path,
    settings: RecorderSettings,
) -> None:
    class FullWriter(RecordingWriter):
        def write(self, *arguments: Any, **others: Any) -> None:
            raise WriteError("No space left on device")

    node = RecorderNode(
        settings,
        lambda path, overwrite, roots: FullWriter(path, overwrite=overwrite, roots=roots),
        context=ros_context,
    )
    ros_executor.add_node(node)
    latched = ros_node.create_publisher(String, "/robot_description", LATCHED)
    latched.publish(String(data="<robot/>"))
    start(call, tmp_path / "full.mcap")
    wait_for(lambda: node.failure)
    answer = stop(call)
    assert answer.status.code == StatusCode.FAILURE
    assert "No space left" in answer.status.message
    assert start(call, tmp_path / "next.mcap").status.code == StatusCode.SUCCESS
    wait_for(lambda: node.failure)  # of this one too, or the end of the node would say it


def test_messages_that_never_arrived_are_said_by_stop_and_by_the_file(
    recorder: RecorderNode,
    call: Any,
    ros_node: Any,
    ros_executor: Any,
    wait_for: Any,
    tmp_path: Path,
) -> None:
    """As of a recorder that was suspended while more came than are kept for it."""
    publisher = ros_node.create_publisher(String, "/robot_description", 10)
    path = tmp_path / "suspended.mcap"
    start(call, path)
    wait_for(lambda: publisher.get_subscription_count(), what="the recorder listens")
    number = recorder._listener._count
    number("/robot_description", 1)
    number("/robot_description", 9)
    answer = stop(call)
    assert answer.status.code == StatusCode.SUCCESS
    assert answer.dropped == 7
    assert "7 lost: they never arrived" in answer.status.message
    assert "7 messages never arrived at the recorder" in read_raw(path).problems


def test_a_recording_that_lost_its_file_says_so_and_goes_on_in_another(
    recorder: RecorderNode, ros_node: Any, call: Any, wait_for: Any, tmp_path: Path
) -> None:
    latched = ros_node.create_publisher(String, "/robot_description", LATCHED)
    latched.publish(String(data="<robot/>"))
    start(call, tmp_path / "shift.mcap")
    wait_for(lambda: recorder.messages)
    (tmp_path / "shift.mcap").unlink()
    wait_for(lambda: recorder.failure)
    assert "deleted, moved or replaced" in recorder.failure
    assert "shift_continued.mcap" in recorder.failure
    wait_for(lambda: recorder.messages)  # what is latched comes again
    answer = stop(call)
    assert answer.status.code == StatusCode.FAILURE
    assert answer.path == str(tmp_path / "shift_continued.mcap")
    assert answer.messages > 0
    assert read_raw(tmp_path / "shift_continued.mcap").problems == ()
    assert start(call, tmp_path / "shift.mcap").status.code == StatusCode.SUCCESS
    assert stop(call).status.code == StatusCode.SUCCESS


def test_a_file_in_the_way_of_the_next_is_warned_of_and_the_present_one_goes_on(
    recorder: RecorderNode,
    ros_node: Any,
    ros_executor: Any,
    call: Any,
    wait_for: Any,
    tmp_path: Path,
) -> None:
    heard: list[DiagnosticStatus] = []

    def hear(message: DiagnosticArray) -> None:
        heard.extend(each for each in message.status if "goes on" in each.message)

    ros_executor.run(
        lambda: ros_node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
    )
    publisher = ros_node.create_publisher(String, "/robot_description", LATCHED)
    start(call, tmp_path / "shift.mcap", split_duration=1.0)
    (tmp_path / "shift_1.mcap").write_text("another's")

    def warned() -> bool:
        publisher.publish(String(data="<robot/>"))
        return bool(heard)

    wait_for(warned, what="the warning")
    assert heard[0].level == DiagnosticStatus.WARN
    answer = stop(call)
    assert answer.status.code == StatusCode.SUCCESS
    assert "not split: " in answer.status.message
    assert "shift_1.mcap is there already" in answer.status.message
    assert answer.paths == [str(tmp_path / "shift.mcap")]
    assert (tmp_path / "shift_1.mcap").read_text() == "another's"


def test_the_planners_cell_is_attached(
    recorder: RecorderNode, ros_node: Any, call: Any, wait_for: Any, tmp_path: Path
) -> None:
    def answer(request: GetCell.Request, response: GetCell.Response) -> GetCell.Response:
        response.status.code = int(StatusCode.SUCCESS)
        response.cell_yaml = "name: here"
        response.robot_description = "<robot/>"
        return response

    ros_node.create_service(GetCell, "/ir_planner/get_cell", answer)
    start(call, tmp_path / "cell.mcap")
    wait_for(lambda: recorder.cell_attached)
    stop(call)
    raw = read_raw(tmp_path / "cell.mcap")
    assert raw.attachment("cell.yaml") == b"name: here"
    assert raw.attachment("robot.urdf") == b"<robot/>"
    assert "ir_planner" in raw.fact("packages")


def test_an_unknown_cell_is_refused_before_a_file_is_made(
    recorder: RecorderNode, tmp_path: Path
) -> None:
    with pytest.raises(RecorderError, match="nowhere"):
        recorder.start(str(tmp_path / "d.mcap"), cell="nowhere")
    assert not (tmp_path / "d.mcap").exists()


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
def test_ir_record_finishes_its_file_on_signals(number: int, tmp_path: Path, wait_for: Any) -> None:
    path = tmp_path / "signals.mcap"
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    command = [
        sys.executable,
        "-m",
        "ir_recorder.node",
        str(path),
        "--root",
        str(tmp_path),
        "--topics",
        "/rosout",
    ]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE)
    try:
        wait_for(lambda: (path.exists() and path.stat().st_size) or process.poll() is not None)
        process.send_signal(number)
        process.send_signal(number)  # a nervous second one
        _, said = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 0, said
    assert read_raw(path).problems == ()
    assert read_raw(path).fact("version")


def test_ir_record_ends_with_1_when_the_disk_is_full(
    tmp_path: Path, ros_domain_id: int, wait_for: Any
) -> None:
    """A limit on the size of files stands for the full disk; what the middleware shares is
    smaller.
    """
    path = tmp_path / "full.mcap"
    environment = {
        **os.environ,
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "ROS_DOMAIN_ID": str(ros_domain_id),
    }
    command = [
        sys.executable,
        "-m",
        "ir_recorder.node",
        str(path),
        "--root",
        str(tmp_path),
        "--topics",
        "/text",
    ]
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    node = Node("talker", context=context)
    publisher = node.create_publisher(String, "/text", 10)
    process = subprocess.Popen(
        command,
        env=environment,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000)),
    )
    text = "".join(chr(33 + int(k)) for k in np.random.default_rng(0).integers(0, 90, 400_000))
    try:
        wait_for(lambda: publisher.get_subscription_count() or process.poll() is not None)

        def listens() -> bool:  # to what is opened last: the graph is whole by then
            return "ir_record" in node.get_node_names() and "/text" in dict(
                node.get_subscriber_names_and_types_by_node("ir_record", "/")
            )

        wait_for(lambda: listens() or process.poll() is not None, what="it is seen in the graph")
        offered = [name for name, _ in node.get_service_names_and_types_by_node("ir_record", "/")]
        assert offered
        assert "/ir_record/start" not in offered
        wait_for(lambda: publisher.publish(String(data=text)) or process.poll() is not None)
        _, errors = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
        node.destroy_node()
        context.try_shutdown()
    assert process.returncode == 1
    assert b"File too large" in errors
    assert b"Traceback" not in errors


def test_recordings_leave_no_objects_behind(
    recorder: RecorderNode, ros_node: Any, ros_executor: Any, wait_for: Any, tmp_path: Path
) -> None:
    topics = [f"/ir_planner/talk_{k}" for k in range(5)]
    publishers = ros_executor.run(
        lambda: [ros_node.create_publisher(String, topic, 1) for topic in topics]
    )

    def record() -> int:
        ros_executor.run(
            lambda: recorder.start(str(tmp_path / "s.mcap"), overwrite=True, topics=topics)
        )
        wait_for(lambda: all(each.get_subscription_count() for each in publishers))
        ros_executor.run(recorder.finish)
        gc.collect()
        return sum(type(each) is weakref.ReferenceType for each in gc.get_objects())

    first = [record() for _ in range(3)][-1]
    assert [record() for _ in range(4)][-1] - first < 2 * len(topics)


def test_a_command_beside_the_recorder_has_a_name_of_its_own_and_offers_no_services(
    recorder: RecorderNode,
    settings: RecorderSettings,
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
) -> None:
    command = ros_executor.add_node(RecorderNode(settings, name=COMMAND_NODE, context=ros_context))
    assert command.get_name() != recorder.get_name()

    def offered(node: str) -> set[str]:
        found = ros_node.get_service_names_and_types_by_node(node, "/")
        return {types[0] for _, types in found if types[0].startswith("ir_msgs/")}

    assert offered(recorder.get_name()) == {
        "ir_msgs/srv/StartRecording",
        "ir_msgs/srv/StopRecording",
    }
    assert offered(command.get_name()) == set()
