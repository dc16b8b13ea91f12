"""Columns of CDR messages agree with the decoder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.reading.cdr import Columns
from ir_recorder.reading.mcap_file import read_raw


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
    assert columns.stamps().tolist() == [
        m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in decoded
    ]


def test_messages_of_different_lengths_are_one_column() -> None:
    schema = SchemaLibrary().schema("sensor_msgs/msg/JointState")
    messages = [
        serialize_message(JointState(name=["a"] * count, position=[float(count)] * count))
        for count in (1, 3, 0, 2)
    ]
    positions = Columns(messages, schema.name, schema.text).numbers("position", 3)
    expected = [[1, np.nan, np.nan], [3, 3, 3], [np.nan] * 3, [2, 2, np.nan]]
    np.testing.assert_array_equal(positions, expected)
