"""A recording with damaged bytes anywhere: read in part or refused, in words that can be
printed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from ir_msgs_py import names
from ir_recorder import RecorderError
from ir_recorder.format.qos import QosOffer
from ir_recorder.reading.reader import read_recording
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter

CASES = 400
SECOND = 10**9
SENTENCE_MAX = 4_000


def recorded(path: Path) -> bytes:
    """A recording of joint states, one each second."""
    session = RecordingSession(RecordingWriter(path), {}, 10**18)
    session.open_topic("/joint_states", "sensor_msgs/msg/JointState", [QosOffer()])
    for k in range(100):
        msg = JointState(name=list(names.JOINT_NAMES), position=[0.01 * k] * 6, velocity=[0.0] * 6)
        msg.header.stamp.sec = k
        session.message("/joint_states", serialize_message(msg), 10**18 + k * SECOND)
    session.finish()
    return path.read_bytes()


def damaged(data: bytes, generator: np.random.Generator) -> bytes:
    """Some places overwritten, cut out, or filled with anything."""
    result = bytearray(data)
    for _ in range(int(generator.integers(1, 6))):
        at = int(generator.integers(len(result)))
        length = int(generator.integers(1, 60))
        noise = generator.integers(0, 256, length, dtype=np.uint8).tobytes()
        change = int(generator.integers(4))
        if change == 0:
            result[at] = noise[0]
        elif change == 1:
            result[at : at + 8] = b"\xff" * 8
        elif change == 2:
            del result[at : at + length]
        else:
            result[at:at] = noise
    return bytes(result)


def test_whatever_is_damaged_the_words_can_be_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = recorded(tmp_path / "whole.mcap")
    generator = np.random.default_rng(1)
    path = tmp_path / "damaged.mcap"
    read = 0
    for _ in range(CASES):
        path.write_bytes(damaged(whole, generator))
        try:
            said = read_recording(path).problems
            read += 1
        except RecorderError as error:
            said = (str(error),)
        assert all(len(sentence) <= SENTENCE_MAX and sentence.isprintable() for sentence in said), (
            said
        )
    assert read > CASES // 2
    assert "".join(capfd.readouterr()) == ""
