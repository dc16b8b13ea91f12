"""The columns of many CDR messages: the project's reader beside mcap-ros2-support and rosbags."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from ir_msgs_py.arrays import FloatArray
from ir_recorder.errors import ReadError
from ir_recorder.reading.cdr import Columns
from ir_recorder.reading.mcap_file import RawChannel, read_raw

Read = Callable[[Sequence[bytes]], FloatArray]
DAMAGED = 2000


def readers_of(channel: RawChannel) -> dict[str, Read]:
    """Each gives positions (N, 6) of joint states."""
    schema = Schema(1, channel.schema_text.encode(), channel.schema_encoding, channel.type)
    decode = DecoderFactory().decoder_for("cdr", schema)
    assert decode is not None
    store = get_typestore(Stores.ROS2_JAZZY)
    return {
        "this project": lambda messages: Columns(
            messages, channel.type, channel.schema_text
        ).numbers("position", 6),
        "mcap-ros2-support": lambda messages: np.array([decode(m).position for m in messages]),
        "rosbags": lambda messages: np.array(
            [_position(store.deserialize_cdr(m, channel.type)) for m in messages]
        ),
    }


def _position(message: Any) -> Any:
    return message.position


def reader_rows(path: Path, most: int) -> Iterator[dict[str, Any]]:
    """Processor time per message; whether all agree; what damaged messages do to each."""
    channel = read_raw(path).channel("/joint_states")
    assert channel is not None
    messages = channel.messages[:most]
    expected = None
    damaged = damaged_messages(messages[0])
    for name, read in readers_of(channel).items():
        begun = time.process_time()
        found = read(messages)
        seconds = time.process_time() - begun
        expected = found if expected is None else expected
        refused, wrong = outcome_of(read, damaged)
        yield {
            "case": "reader",
            "reader": name,
            "messages": len(messages),
            "us_per_message": 1e6 * seconds / len(messages),
            "equal": bool(np.array_equal(found, expected)),
            "refused": refused,
            "other_errors": wrong,
        }


def damaged_messages(message: bytes) -> list[bytes]:
    """The message cut short, or with some bytes replaced."""
    chance = random.Random(1)
    found = []
    for _ in range(DAMAGED):
        data = bytearray(message)
        for _ in range(chance.randint(1, 8)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        found.append(bytes(data[: chance.randint(1, len(data))] if chance.random() < 0.5 else data))
    return found


def outcome_of(read: Read, damaged: Sequence[bytes]) -> tuple[int, int]:
    """How many damaged messages end in an error with a sentence, and in any other exception."""
    refused = other = 0
    for message in damaged:
        try:
            read([message])
        except ReadError:
            refused += 1
        except Exception:  # what the library happens to raise
            other += 1
    return refused, other
