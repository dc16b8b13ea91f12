"""Joint states of a ROS 2 bag in SQLite are read as those of any trace."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from mcap.writer import Writer
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from ir_recorder.errors import RecorderError
from ir_recorder.traces import Trace, read_mapping, read_traces

NAMES = ("joint_a1", "joint_a2")


def bag(path: Path, messages: list[JointState], kind: str = "sensor_msgs/msg/JointState") -> Path:
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
        columns = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB"
        file.execute(f"CREATE TABLE messages({columns})")
        file.execute("INSERT INTO topics VALUES (1, '/joint_states', ?)", (kind,))
        rows = [(k, 1, 10**9 + k, serialize_message(each)) for k, each in enumerate(messages)]
        file.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows)
    return path


def states(count: int) -> list[JointState]:
    return [
        JointState(
            header=Header(stamp=Time(sec=5, nanosec=10_000_000 * k)),
            name=list(NAMES),
            position=[0.1 * k, -0.2 * k],
            effort=[1.0 * k, 2.0],
        )
        for k in range(count)
    ]


def test_positions_and_efforts_are_read_by_the_stamps(tmp_path: Path) -> None:
    (trace,) = read_traces(bag(tmp_path / "run.db3", states(20)), None, NAMES)
    assert trace.time == pytest.approx(0.01 * np.arange(20))
    assert trace.columns["joint_a2"] == pytest.approx(-0.2 * np.arange(20))
    assert trace.columns["joint_a1_effort"] == pytest.approx(np.arange(20))
    assert "joint_a1_velocity" not in trace.columns


def test_what_has_no_joint_states_or_is_no_bag_is_refused(tmp_path: Path) -> None:
    other = bag(tmp_path / "other.db3", states(3), "std_msgs/msg/String")
    with pytest.raises(RecorderError, match="there are no messages of sensor_msgs"):
        read_traces(other, None, NAMES)
    text = tmp_path / "text.db3"
    text.write_text("time,joint_a1\n")
    with pytest.raises(RecorderError, match="can't be read as a bag"):
        read_traces(text, None, NAMES)
    for names, said in (
        (["joint_a2", "joint_b"], "name other joints"),
        (["joint_a1", "joint_a1"], "name other joints"),
    ):
        mixed = states(4)
        mixed[2].name = names
        with pytest.raises(RecorderError, match=said):
            read_traces(bag(tmp_path / f"{names[1]}.db3", mixed), None, NAMES)
    twice = states(4)
    for each in twice:
        each.name = ["joint_a1", "joint_a1"]
    with pytest.raises(RecorderError, match="name a joint twice"):
        read_traces(bag(tmp_path / "twice.db3", twice), None, NAMES)


def test_joints_are_read_by_name_in_whichever_order(tmp_path: Path) -> None:
    (plain,) = read_traces(bag(tmp_path / "plain.db3", states(20)), None, NAMES)
    mixed = states(20)
    for each in mixed[::2]:
        each.name.reverse()
        each.position.reverse()
        each.effort.reverse()
    mixed.insert(7, JointState(name=["finger"], position=[0.1]))
    (trace,) = read_traces(bag(tmp_path / "mixed.db3", mixed), None, NAMES)
    assert trace.time.tolist() == plain.time.tolist()
    assert trace.columns.keys() == plain.columns.keys()
    for name, values in plain.columns.items():
        assert trace.columns[name].tolist() == values.tolist()
    assert trace.problems == ("1 joint states of finger: left out",)


def with_topic(path: Path, name: str, kind: str, messages: list[bytes], *, first: bool) -> Path:
    """The bag with one more topic, before or behind the others."""
    with sqlite3.connect(path) as file:
        number = 0 if first else 2
        file.execute("INSERT INTO topics VALUES (?, ?, ?)", (number, name, kind))
        rows = [(number, 10**9 + k, each) for k, each in enumerate(messages)]
        file.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    return path


def test_states_are_read_and_not_commands_however_many(tmp_path: Path) -> None:
    commands = states(40)
    for each in commands:
        each.position = [9.0, 9.0]
    path = bag(tmp_path / "run.db3", states(20))
    raw = [serialize_message(each) for each in commands]
    with_topic(path, "/joint_commands", "sensor_msgs/msg/JointState", raw, first=True)
    (trace,) = read_traces(path, None, NAMES)
    assert trace.columns["joint_a2"] == pytest.approx(-0.2 * np.arange(20))
    assert "/joint_commands" in trace.problems[0]


def read_by(path: Path, mapping: str) -> Trace:
    """The trace by a mapping of these lines."""
    file = path.with_suffix(".yaml")
    file.write_text(f"format: ir_trace/1\n{mapping}\n")
    return read_traces(path, read_mapping(file), NAMES)[0]


def test_of_topics_that_may_be_commands_none_is_read_without_being_named(tmp_path: Path) -> None:
    commands = states(40)
    for each in commands:
        each.position = [9.0, 9.0]
    path = bag(tmp_path / "run.db3", states(20))
    raw = [serialize_message(each) for each in commands]
    with_topic(path, "/servo/in", "sensor_msgs/msg/JointState", raw, first=True)
    with sqlite3.connect(path) as file:
        file.execute("UPDATE topics SET name = '/servo/out' WHERE id = 1")
    with pytest.raises(
        RecorderError,
        match=r"/servo/in, /servo/out are all of .* which was measured, as topic: NAME$",
    ):
        read_traces(path, None, NAMES)
    assert read_by(path, "topic: servo/out").columns["joint_a2"][-1] == pytest.approx(-3.8)
    assert read_by(path, "topic: /servo/in").columns["joint_a2"][-1] == pytest.approx(9.0)
    with pytest.raises(RecorderError, match="there is no topic /servo of"):
        read_by(path, "topic: /servo")


def test_states_without_names_have_those_of_a_mapping(tmp_path: Path) -> None:
    bare = states(20)
    for each in bare:
        each.name = []
    path = bag(tmp_path / "run.db3", bare)
    with pytest.raises(RecorderError, match="name no joint: a mapping"):
        read_traces(path, None, NAMES)
    trace = read_by(path, "joints: [joint_a2, joint_a1]")
    assert trace.columns["joint_a1"] == pytest.approx(-0.2 * np.arange(20))
    assert trace.columns["joint_a2"] == pytest.approx(0.1 * np.arange(20))
    assert trace.columns["joint_a2_effort"] == pytest.approx(np.arange(20))
    for joints, number in (("[joint_a1]", 1), ("[joint_a1, joint_a2, joint_a3]", 3)):
        with pytest.raises(RecorderError, match=f"has 2 positions, the mapping names {number}"):
            read_by(path, f"joints: {joints}")


def test_a_topic_of_power_is_named_as_not_read(tmp_path: Path) -> None:
    path = bag(tmp_path / "run.db3", states(20))
    with_topic(path, "/power", "std_msgs/msg/Float64", [b"\0\1\0\0" + bytes(8)] * 5, first=False)
    (trace,) = read_traces(path, None, NAMES)
    assert trace.problems == (
        "read is /joint_states; topics that are not: /power (std_msgs/msg/Float64)",
    )


def test_a_clock_that_moved_back_is_refused_and_late_messages_are_not(tmp_path: Path) -> None:
    moved = states(20)
    for each in moved[12:]:
        each.header.stamp.sec = 4
    with pytest.raises(RecorderError, match=r"stamp of joint state 13 is 0\.99 s before"):
        read_traces(bag(tmp_path / "moved.db3", moved), None, NAMES)
    late = states(20)
    late[5], late[6] = late[6], late[5]
    (trace,) = read_traces(bag(tmp_path / "late.db3", late), None, NAMES)
    assert trace.problems == ("1 joint states go back in time: left out",)


def mcap(path: Path, topics: dict[str, list[JointState]], encoding: str = "cdr") -> Path:
    """A bag of others in MCAP."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        kind = "sensor_msgs/msg/JointState"
        schema = writer.register_schema(kind, "ros2msg", b"float64[] position")
        for topic, messages in topics.items():
            channel = writer.register_channel(topic, encoding, schema)
            for k, each in enumerate(messages):
                writer.add_message(channel, 10**9 + k, serialize_message(each), 10**9 + k)
        writer.finish()
    return path


def test_a_bag_of_others_in_mcap_is_read_like_one_in_sqlite(tmp_path: Path) -> None:
    (wanted,) = read_traces(bag(tmp_path / "run.db3", states(20)), None, NAMES)
    (trace,) = read_traces(mcap(tmp_path / "run.mcap", {"/joint_states": states(20)}), None, NAMES)
    assert trace.time.tolist() == wanted.time.tolist()
    assert {name: each.tolist() for name, each in trace.columns.items()} == {
        name: each.tolist() for name, each in wanted.columns.items()
    }


def test_commands_in_mcap_are_not_taken_for_states(tmp_path: Path) -> None:
    commands = states(40)
    for each in commands:
        each.position = [9.0, 9.0]
    path = mcap(tmp_path / "run.mcap", {"/servo/in": commands, "/servo/out": states(20)})
    with pytest.raises(RecorderError, match=r"/servo/in, /servo/out are all of .* as topic: NAME$"):
        read_traces(path, None, NAMES)
    assert read_by(path, "topic: /servo/out").columns["joint_a2"][-1] == pytest.approx(-3.8)


def test_a_bag_in_mcap_that_is_not_cdr_is_refused(tmp_path: Path) -> None:
    path = mcap(tmp_path / "run.mcap", {"/joint_states": states(20)}, "json")
    with pytest.raises(RecorderError, match="there are no messages of sensor_msgs/msg/JointState"):
        read_traces(path, None, NAMES)


def test_names_of_a_mapping_that_the_states_do_not_need_are_said(tmp_path: Path) -> None:
    trace = read_by(bag(tmp_path / "run.db3", states(20)), "joints: [joint_b1, joint_b2]")
    assert "joint_a1" in trace.columns
    said = "joints of the mapping are not used, its states name joint_a1, joint_a2"
    assert said in trace.problems
