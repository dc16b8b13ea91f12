"""Recordings are read without ROS, whole or in part."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ir_msgs.msg import PlcInputs
from ir_recorder.errors import ReadError
from ir_recorder.format.qos import QosOffer
from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.read.cdr import Columns
from ir_recorder.read.raw import read_raw
from ir_recorder.read.reader import read_recording
from ir_recorder.write.session import RecordingSession
from ir_recorder.write.writer import RecordingWriter
from mcap.reader import make_reader
from mcap.records import Schema
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState


def test_series_are_what_was_published(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    assert recording.problems == ()
    joints = recording.joints
    assert joints.names == tuple(f"joint_a{i}" for i in range(1, 7))
    np.testing.assert_allclose(np.degrees(joints.position[0]), [0, -90, 90, 0, 0, 0], atol=1e-12)
    assert joints.position.shape == joints.velocity.shape == joints.effort.shape == (len(joints.time), 6)
    energy = np.cumsum(recording.power.power) * 0.01
    np.testing.assert_allclose(recording.power.energy, energy, rtol=1e-9)
    assert recording.events[0].movement.to_station == "table"
    assert recording.loads[0].text == "none"
    assert recording.fact("hibernation_leave") == "3 s"


def test_levels_in_force_are_preferred_to_those_that_were_sent(tmp_path: Path) -> None:
    kind = "ir_msgs/msg/PlcInputs"
    for topics in (["plc_inputs"], ["plc_inputs", "plc_inputs_in_force"]):
        path = tmp_path / f"{len(topics)}.mcap"
        session = RecordingSession(RecordingWriter(path), {}, 10**18)
        for topic in topics:
            name = f"/ir_sim_driver/{topic}"
            session.open_topic(name, kind, [QosOffer(transient_local=True)])
            sent = PlcInputs(ab=topic == "plc_inputs", hib=topic != "plc_inputs")
            session.message(name, serialize_message(sent), 10**18)
        session.finish()
        series = read_recording(path).plc_inputs
        levels = dict(zip(series.names, series.levels[0].tolist(), strict=True))
        assert (levels["ab"], levels["hib"]) == ((1, 0) if len(topics) == 1 else (0, 1))


def test_columns_agree_with_the_decoder_message_by_message(demo_file: Path) -> None:
    raw = read_raw(demo_file)
    channel = raw.channel("/ir_sim_driver/controller_state")
    columns = Columns(channel.messages, channel.type, channel.schema_text)

    decode = DecoderFactory().decoder_for(
        "cdr", Schema(1, channel.schema_text.encode(), "ros2msg", channel.type)
    )
    decoded = [decode(data) for data in channel.messages]
    assert columns.texts("trajectory_id") == [message.trajectory_id for message in decoded]
    assert columns.numbers("path_time").tolist() == [message.path_time for message in decoded]
    assert columns.stamps().tolist() == [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in decoded]


def test_messages_of_different_lengths_are_one_column() -> None:
    schema = SchemaLibrary().schema("sensor_msgs/msg/JointState")
    messages = [
        serialize_message(JointState(name=["a"] * count, position=[float(count)] * count))
        for count in (1, 3, 0, 2)
    ]
    positions = Columns(messages, schema.name, schema.text).numbers("position", 3)
    expected = [[1, np.nan, np.nan], [3, 3, 3], [np.nan] * 3, [2, 2, np.nan]]
    np.testing.assert_array_equal(positions, expected)


def test_a_truncated_file_gives_what_is_left(demo_file: Path, tmp_path: Path) -> None:
    data = demo_file.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) * 2 // 3])
    recording = read_recording(cut)
    assert 0 < len(recording.joints.time) < len(read_recording(demo_file).joints.time)
    assert any("ends early" in problem for problem in recording.problems)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.5, 0.999])
def test_no_cut_is_too_early_or_late(demo_file: Path, tmp_path: Path, share: float) -> None:
    data = demo_file.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(len(data) * share)])
    assert read_recording(cut).problems


def test_a_damaged_chunk_costs_only_itself(demo_file: Path, tmp_path: Path) -> None:
    data = bytearray(demo_file.read_bytes())
    with demo_file.open("rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[2]
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    data[middle : middle + 64] = bytes(64)
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(data)
    recording, whole = read_recording(broken), read_recording(demo_file)
    assert any("is damaged" in problem for problem in recording.problems)
    assert recording.joints.time[-1] == pytest.approx(whole.joints.time[-1], abs=1.0)
    assert len(recording.joints.time) < len(whole.joints.time)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 a zip", b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_refused_with_a_sentence(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=r"x\.mcap"):
        read_recording(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="No such file"):
        read_recording(tmp_path / "none.mcap")


def test_json_channels_and_missing_topics_are_told(tmp_path: Path) -> None:
    path = tmp_path / "json.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("thing", "jsonschema", b"{}")
        channel = writer.register_channel("/joint_states", "json", schema)
        writer.add_message(channel, 10, b"{}", 10)
        writer.finish()
    recording = read_recording(path)
    assert recording.joints is None
    assert any("is json, not cdr" in problem for problem in recording.problems)
    assert any("power_state isn't in the recording" in problem for problem in recording.problems)


def test_messages_that_do_not_fit_their_definition_are_told(tmp_path: Path) -> None:
    path = tmp_path / "short.mcap"
    schema = SchemaLibrary().schema("sensor_msgs/msg/JointState")
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        number = writer.register_schema(schema.name, "ros2msg", schema.text.encode())
        channel = writer.register_channel("/joint_states", "cdr", number)
        writer.add_message(channel, 10, b"\0\1\0\0\1\2", 10)
        writer.finish()
    recording = read_recording(path)
    assert recording.joints is None
    assert any("/joint_states can't be read" in problem for problem in recording.problems)


def test_reading_needs_no_ros() -> None:
    code = (
        "import sys, ir_recorder, ir_recorder.report, ir_recorder.report_main, ir_recorder.report.picture;"
        "print([m for m in sys.modules if m.split('.')[0] in ('rclpy', 'ir_msgs', 'rosbags', 'matplotlib')])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
