"""Recordings are read without ROS, whole or in part."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from mcap.writer import Writer
from rcl_interfaces.msg import Log
from rclpy.serialization import serialize_message

from ir_msgs.msg import PlcInputs, PowerState, Signal
from ir_recorder.errors import ReadError
from ir_recorder.format.qos import QosOffer
from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.reading.reader import read_recording
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter


def test_series_are_what_was_published(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    assert recording.problems == ()
    joints = recording.joints
    assert joints.names == tuple(f"joint_a{i}" for i in range(1, 7))
    np.testing.assert_allclose(np.degrees(joints.position[0]), [0, -90, 90, 0, 0, 0], atol=1e-12)
    assert (
        joints.position.shape
        == joints.velocity.shape
        == joints.effort.shape
        == (len(joints.time), 6)
    )
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


def test_what_carries_no_stamp_is_in_the_time_of_a_plant_that_lags(tmp_path: Path) -> None:
    start = 10**18
    power = "/ir_sim_driver/power_state"
    inputs = "/ir_sim_driver/plc_inputs_in_force"
    session = RecordingSession(RecordingWriter(tmp_path / "lagging.mcap"), {}, start)
    session.open_topic(power, "ir_msgs/msg/PowerState", [QosOffer()])
    session.open_topic(inputs, "ir_msgs/msg/PlcInputs", [QosOffer(transient_local=True)])
    session.open_topic("/ir_program_runner/signals", "ir_msgs/msg/Signal", [QosOffer()])
    for second in range(11):  # the plant takes two seconds of the recorder's clock for each
        reading = PowerState(mode=0)
        reading.header.stamp.sec = start // 10**9 + second
        session.message(power, serialize_message(reading), start + 2 * second * 10**9)
    session.message(inputs, serialize_message(PlcInputs(ab=True)), start + 13 * 10**9)
    closed = Signal(name="door_closed", value=True)
    session.message("/ir_program_runner/signals", serialize_message(closed), start + 30 * 10**9)
    session.finish()
    recording = read_recording(tmp_path / "lagging.mcap")
    assert recording.plc_inputs.time == pytest.approx([6.5])
    assert recording.signals[0].time == pytest.approx(20.0)  # ten seconds after the last reading


def test_json_channels_and_missing_topics_are_reported(tmp_path: Path) -> None:
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


def test_messages_that_do_not_fit_their_definition_are_reported(tmp_path: Path) -> None:
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
        "import sys, ir_recorder, ir_recorder.report, ir_recorder.report_main, "
        "ir_recorder.report.picture;print([m for m in sys.modules if m.split('.')[0] in "
        "('rclpy', 'ir_msgs', 'rosbags', 'matplotlib')])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def two_cells(path: Path) -> Path:
    """A recording of everything in a graph with two cells: loads, hardware and warnings of both."""
    session = RecordingSession(RecordingWriter(path), {}, 10**18)
    diagnostics = "diagnostic_msgs/msg/DiagnosticArray"
    session.open_topic("/diagnostics", diagnostics, [QosOffer()])
    session.open_topic("/rosout", "rcl_interfaces/msg/Log", [QosOffer()])
    for cell in ("left", "right"):
        topic = f"/{cell}/ir_sim_driver/power_state"
        session.open_topic(topic, "ir_msgs/msg/PowerState", [QosOffer()])
        session.message(topic, serialize_message(PowerState(power=float(len(cell)))), 10**18)
        status = DiagnosticStatus(
            name=f"{cell}/ir_sim_driver: plant",
            hardware_id=cell,
            values=[KeyValue(key="load", value=f"load {cell}")],
        )
        session.message("/diagnostics", serialize_message(DiagnosticArray(status=[status])), 10**18)
        log = Log(level=30, name=f"{cell}.ir_planner", msg=f"warning {cell}")
        session.message("/rosout", serialize_message(log), 10**18)
    return session.finish().path


def test_only_what_the_chosen_cell_said_is_read(tmp_path: Path) -> None:
    path = two_cells(tmp_path / "two.mcap")
    for cell in ("left", "right"):
        recording = read_recording(path, namespace=cell)
        assert [event.text for event in recording.loads] == [f"load {cell}"]
        assert [event.text for event in recording.warnings] == [f"warning {cell}"]
        assert recording.hardware == cell
        assert recording.power is not None
        assert recording.power.power.tolist() == [len(cell)]


def test_a_recording_of_several_cells_says_which_one_is_read(tmp_path: Path) -> None:
    path = two_cells(tmp_path / "two.mcap")
    assert any(
        "(/left, /right); --namespace chooses" in problem
        for problem in read_recording(path).problems
    )
    with pytest.raises(
        ReadError, match=r"no cell '/middle' in the recording; there is: /left, /right"
    ):
        read_recording(path, namespace="middle")
