"""A recording is the same whatever the order of its messages in the file, and in a bag."""

from __future__ import annotations

import dataclasses
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from ir_recorder.analysis import analyse
from ir_recorder.analysis.checks import findings
from ir_recorder.reading.mcap_file import RawChannel, RawRecording, read_raw
from ir_recorder.reading.reader import read_recording
from ir_recorder.reading.recording import Recording
from ir_recorder.traces import read_traces

SEED = 3


def rewritten(
    raw: RawRecording, path: Path, order: np.ndarray, late: dict[int, int] | None = None
) -> Path:
    """All messages in this order; late: ns by which a message is logged later, by its number."""
    rows = [
        (channel, time, message)
        for channel in raw.channels
        for time, message in zip(channel.log_time.tolist(), channel.messages, strict=True)
    ]
    rows.sort(key=lambda row: row[1])
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE, chunk_size=4096)
        writer.start()
        channels: dict[str, int] = {}
        for channel in raw.channels:
            schema = writer.register_schema(
                channel.type, channel.schema_encoding, channel.schema_text.encode()
            )
            channels[channel.topic] = writer.register_channel(channel.topic, "cdr", schema)
        for each in raw.attachments:
            writer.add_attachment(0, 0, each.name, each.media_type, each.data)
        writer.add_metadata("facts", dict(raw.facts))
        for k in order.tolist():
            channel, time, message = rows[k]
            at = time + (late or {}).get(k, 0)
            writer.add_message(channels[channel.topic], at, message, time, sequence=k)
        writer.finish()
    return path


def bag(raw: RawRecording, path: Path, *, definitions: bool) -> Path:
    """All messages in a bag of ROS 2."""
    with sqlite3.connect(path) as file:
        file.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, "
            "serialization_format TEXT, offered_qos_profiles TEXT)"
        )
        columns = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB"
        file.execute(f"CREATE TABLE messages({columns})")
        if definitions:
            file.execute(
                "CREATE TABLE message_definitions(topic_type TEXT, encoding TEXT, "
                "encoded_message_definition TEXT)"
            )
        for number, channel in enumerate(raw.channels, 1):
            row = (number, channel.topic, channel.type, "cdr", "")
            file.execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", row)
            if definitions:
                file.execute(
                    "INSERT INTO message_definitions VALUES (?, 'ros2msg', ?)",
                    (channel.type, channel.schema_text),
                )
            file.executemany(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
                [
                    (number, int(time), data)
                    for time, data in zip(channel.log_time, channel.messages, strict=True)
                ],
            )
    return path


def told(recording: Recording) -> list[tuple[str, str]]:
    """Verdict and sentence of every check."""
    return [(each.verdict.name, each.name) for each in findings(analyse(recording))]


def test_the_order_in_the_file_does_not_matter(demo_file: Path, tmp_path: Path) -> None:
    raw = read_raw(demo_file)
    count = sum(len(channel.messages) for channel in raw.channels)
    order = np.random.default_rng(SEED).permutation(count)
    mixed = read_recording(rewritten(raw, tmp_path / "mixed.mcap", order))
    whole = read_recording(demo_file)
    assert mixed.problems == ()
    assert told(mixed) == told(whole)
    for name in ("joints", "power", "controller"):
        one, other = (dataclasses.astuple(getattr(each, name)) for each in (mixed, whole))
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_messages_that_arrive_late_are_put_in_order_and_told(
    demo_file: Path, tmp_path: Path
) -> None:
    raw = read_raw(demo_file)
    count = sum(len(channel.messages) for channel in raw.channels)
    late = dict.fromkeys(range(100, count, 53), 40_000_000)
    path = rewritten(raw, tmp_path / "late.mcap", np.arange(count), late)
    recording = read_recording(path)
    assert any("arrived after later ones, by at most" in each for each in recording.problems)
    assert recording.joints is not None
    assert (np.diff(recording.joints.time) >= 0.0).all()
    whole = read_recording(demo_file).joints
    assert whole is not None
    np.testing.assert_array_equal(recording.joints.position, whole.position)


@pytest.mark.parametrize("definitions", [True, False])
def test_a_bag_is_the_same_recording(demo_file: Path, tmp_path: Path, *, definitions: bool) -> None:
    path = bag(read_raw(demo_file), tmp_path / "run.db3", definitions=definitions)
    recording = read_recording(path)
    whole = read_recording(demo_file)
    assert recording.problems == ()
    assert recording.joints is not None and whole.joints is not None  # noqa: PT018
    np.testing.assert_array_equal(recording.joints.position, whole.joints.position)
    assert recording.power is not None and whole.power is not None  # noqa: PT018
    np.testing.assert_array_equal(recording.power.energy, whole.power.energy)
    named = [[(each.time, each.event) for each in one.events] for one in (recording, whole)]
    assert named[0] == named[1]
    joints, meter = read_traces(path)
    assert "joint_a1" in joints.columns
    assert "power" in meter.columns


def changed(raw: RawRecording, topic: str, messages: tuple[bytes, ...]) -> RawRecording:
    def one(channel: RawChannel) -> RawChannel:
        return (
            dataclasses.replace(
                channel,
                messages=messages,
                log_time=channel.log_time[: len(messages)],
            )
            if channel.topic.endswith(topic)
            else channel
        )

    return dataclasses.replace(raw, channels=tuple(map(one, raw.channels)))


@pytest.mark.sampled
@pytest.mark.parametrize("topic", ["joint_states", "power_state", "controller_state"])
@pytest.mark.parametrize("content", [b"", b"\0", b"\0\1\0\0", b"\0\1\0\0" + 40 * b"\xff"])
def test_empty_and_foreign_messages_on_a_known_topic_are_one_sentence(
    short_file: Path, tmp_path: Path, topic: str, content: bytes
) -> None:
    """One among hundreds, and all of them."""
    raw = read_raw(short_file)
    messages = next(each for each in raw.channels if each.topic.endswith(topic)).messages
    one = (*messages[:20], content, *messages[21:])
    for number, several in enumerate((one, (content,) * 20)):
        other = changed(raw, topic, several)
        path = tmp_path / f"{number}.mcap"
        count = sum(len(channel.messages) for channel in other.channels)
        recording = read_recording(rewritten(other, path, np.arange(count)))
        assert [each for each in recording.problems if topic in each]
        findings(analyse(recording))
        series = (recording.joints, recording.power, recording.controller)
        assert all(each is not None for each in series) == (number == 0)


@pytest.mark.parametrize("others", [JointState(), JointState(name=["finger"], position=[0.1])])
def test_joint_states_of_a_gripper_or_of_nobody_are_left_out(
    demo_file: Path, tmp_path: Path, others: JointState
) -> None:
    raw = read_raw(demo_file)
    messages = next(each for each in raw.channels if "joint_states" in each.topic).messages
    mixed = (*messages[:20], serialize_message(others), *messages[21:])
    other = changed(raw, "joint_states", mixed)
    count = sum(len(channel.messages) for channel in other.channels)
    path = rewritten(other, tmp_path / "mixed.mcap", np.arange(count))
    recording = read_recording(path)
    assert recording.joints is not None
    assert len(recording.joints.time) == len(messages) - 1
    said = "finger" if others.name else "no joint"
    assert any(f"1 messages of {said} are left out" in each for each in recording.problems)
    (trace, _) = read_traces(bag(other, tmp_path / "mixed.db3", definitions=False))
    assert len(trace.time) == len(messages) - 1


def test_joint_states_are_read_by_name_in_whichever_order(demo_file: Path, tmp_path: Path) -> None:
    raw = read_raw(demo_file)
    messages = next(each for each in raw.channels if "joint_states" in each.topic).messages
    turned = []
    for data in messages[1::2]:
        state = deserialize_message(data, JointState)
        for values in (state.name, state.position, state.velocity, state.effort):
            values.reverse()
        turned.append(serialize_message(state))
    mixed = list(messages)
    mixed[1::2] = turned
    other = changed(raw, "joint_states", tuple(mixed))
    count = sum(len(channel.messages) for channel in other.channels)
    read = read_recording(rewritten(other, tmp_path / "mixed.mcap", np.arange(count)))
    plain = read_recording(demo_file)
    assert read.joints is not None
    assert plain.joints is not None
    assert read.joints.names == plain.joints.names
    for kind in ("position", "velocity", "effort"):
        assert np.array_equal(getattr(read.joints, kind), getattr(plain.joints, kind))
    assert read.problems == plain.problems
