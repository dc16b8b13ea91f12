"""What is left of a damaged file is read; what is no recording is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from ir_recorder import RecorderError, analyse, findings
from ir_recorder.errors import ReadError
from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.reading.reader import read_recording
from ir_recorder.report import report_html


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
    recording = read_recording(broken)
    whole = read_recording(demo_file)
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


def test_a_message_from_the_far_future_costs_only_itself(tmp_path: Path) -> None:
    path = tmp_path / "future.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/text", "cdr", schema)
        for time in (1, 2**63, 2**64 - 1, 2):
            writer.add_message(channel, time, b"\0\1\0\0", time)
        writer.finish()
    raw = read_raw(path)
    assert raw.channel("/text").log_time.tolist() == [1, 2]
    assert "2 messages have a time after the year 2260" in raw.problems


@pytest.mark.long
def test_mutilated_recordings_are_read_or_refused(short_file: Path, tmp_path: Path) -> None:
    """Bytes changed, dropped and put in at random: a page, or a sentence."""
    generator = np.random.default_rng(0)
    whole = short_file.read_bytes()
    path = tmp_path / "m.mcap"
    for _ in range(40):
        data = bytearray(whole)
        for _ in range(int(generator.choice([1, 3, 30]))):
            at = int(generator.integers(len(data)))
            kind = generator.integers(4)
            if kind == 0:
                data[at] = int(generator.integers(256))
            elif kind == 1:
                data[at : at + 8] = b"\xff" * 8
            elif kind == 2:
                del data[at : at + int(generator.integers(1, 100))]
            else:
                data[at:at] = bytes(int(generator.integers(1, 50)))
        path.write_bytes(data)
        try:
            analysis = analyse(read_recording(path))
        except RecorderError:
            continue
        assert report_html(analysis, findings(analysis))
