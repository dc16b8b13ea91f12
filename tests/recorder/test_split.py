"""Laws: the files of a split recording are together what one file would be, and each can be read
alone.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from mcap.reader import make_reader

from ir_recorder.errors import RecorderError, WriteError
from ir_recorder.format.contents import Split, is_further_part, part_path
from ir_recorder.format.qos import QosOffer
from ir_recorder.reading.mcap_file import RawRecording, read_raw
from ir_recorder.recording.cell_files import CellFiles
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.split_files import check_free
from ir_recorder.recording.writer import RecordingSummary, RecordingWriter

TOPICS = {
    "/joint_states": ("sensor_msgs/msg/JointState", [QosOffer()]),
    "/robot_description": ("std_msgs/msg/String", [QosOffer(transient_local=True)]),
    "/tf_static": ("std_msgs/msg/String", [QosOffer(transient_local=True)] * 2),
}


def recorded(path: Path, split: Split, seed: int) -> RecordingSummary:
    """Ten seconds of all topics, the same for the same seed; latched ones come rarely."""
    chance = random.Random(seed)
    session = RecordingSession(RecordingWriter(path), {"shift": "night"}, 0, split)
    session.attach_cell(CellFiles("name: here", "<robot/>"), 0)
    for topic in ("/robot_description", "/joint_states"):
        session.open_topic(topic, *TOPICS[topic])
    for k in range(2500):
        time = k * 4_000_000
        if k == 1200:  # a topic that comes late
            session.open_topic("/tf_static", *TOPICS["/tf_static"])
        if k in (3, 700):
            session.message("/robot_description", chance.randbytes(200), time)
        if k in (1250, 1260, 1270):
            session.message("/tf_static", chance.randbytes(50), time)
        session.message("/joint_states", chance.randbytes(1200), time)
    return session.finish()


def messages_of(raw: RawRecording) -> dict[str, list[tuple[int, bytes]]]:
    return {c.topic: list(zip(c.log_time.tolist(), c.messages, strict=True)) for c in raw.channels}


@pytest.mark.parametrize("leaves", [0, 6_000_000_000])
def test_a_file_in_the_way_of_the_next_loses_nothing(leaves: int, tmp_path: Path) -> None:
    """The present file goes on meanwhile, and says so; leaves: when [ns] the other one goes."""
    split = Split(duration=1.5)
    other = tmp_path / "mine_2.mcap"
    other.write_bytes(b"somebody's")
    session = RecordingSession(RecordingWriter(tmp_path / "mine.mcap"), {}, 0, split)
    session.open_topic("/joint_states", *TOPICS["/joint_states"])
    sent = [(k * 4_000_000, bytes([k % 256]) * 40) for k in range(2500)]
    said = set()
    for time, data in sent:
        if time == leaves > 0:
            assert other.read_bytes() == b"somebody's"
            other.unlink()
        session.message("/joint_states", data, time)
        said.add(session.blocked)
    summary = session.finish()
    assert said == {"", f"{other} is there already; choose another path or set overwrite; "
                    "mine_1.mcap goes on"}  # fmt: skip
    assert bool(summary.blocked) == (leaves == 0)
    assert len(summary.paths) == (5 if leaves else 2)
    assert messages_of(read_raw(summary.path))["/joint_states"] == sent


def test_a_disk_that_refuses_the_end_of_a_file_leaves_no_empty_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: RecordingWriter) -> RecordingSummary:
        raise WriteError("no space left on device")

    session = RecordingSession(RecordingWriter(tmp_path / "a.mcap"), {}, 0, Split(duration=1.0))
    session.open_topic("/joint_states", *TOPICS["/joint_states"])
    session.message("/joint_states", b"\0" * 40, 0)
    session.flush()
    monkeypatch.setattr(RecordingWriter, "finish", full)
    with pytest.raises(WriteError, match="no space"):
        session.message("/joint_states", b"\0" * 40, 2_000_000_000)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


@pytest.mark.parametrize(
    "split", [Split(duration=1.5), Split(size=1_000_000), Split(1_000_000, 2.0)]
)
def test_the_files_are_together_what_one_file_is(split: Split, tmp_path: Path) -> None:
    whole = recorded(tmp_path / "whole.mcap", Split(), 7)
    parts = recorded(tmp_path / "parts.mcap", split, 7)
    assert parts.messages == whole.messages
    assert parts.seconds == whole.seconds
    assert len(parts.paths) > 2
    assert parts.paths == tuple(part_path(parts.path, part) for part in range(len(parts.paths)))
    one = read_raw(whole.path)
    many = read_raw(parts.path)
    assert messages_of(many) == messages_of(one)
    assert many.problems == ()
    assert many.fact("shift") == "night"


def test_each_file_has_the_cell_the_facts_and_what_is_latched(tmp_path: Path) -> None:
    parts = recorded(tmp_path / "parts.mcap", Split(duration=1.5), 8)
    latched = messages_of(read_raw(parts.path))["/robot_description"]
    for path in parts.paths[1:]:
        alone = read_raw(path)
        assert alone.attachment("cell.yaml") == b"name: here"
        assert alone.fact("shift") == "night"
        found = messages_of(alone)
        first = min(time for _, messages in found.items() for time, _ in messages)
        before = [data for time, data in latched if time < first]
        assert found["/robot_description"][0] == (first, before[-1])
    assert [len(messages_of(read_raw(parts.paths[-1]))["/tf_static"])] == [2]  # of two publishers


def test_each_file_is_complete_for_other_readers(tmp_path: Path) -> None:
    parts = recorded(tmp_path / "parts.mcap", Split(duration=3.0), 9)
    for path in parts.paths:
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count > 200


def test_files_that_are_missing_or_of_another_recording_are_named_or_left_out(
    tmp_path: Path,
) -> None:
    parts = recorded(tmp_path / "parts.mcap", Split(duration=1.5), 10)
    count = len(messages_of(read_raw(parts.path))["/joint_states"])
    own = len(messages_of(read_raw(parts.paths[2]))["/joint_states"])
    parts.paths[2].unlink()
    found = read_raw(parts.path)
    assert found.problems == ("parts_2.mcap is missing: what it held is not read",)
    assert len(messages_of(found)["/joint_states"]) == count - own
    other = recorded(tmp_path / "other.mcap", Split(duration=1.5), 11)
    other.paths[1].rename(parts.paths[2])
    assert len(messages_of(read_raw(parts.path))["/joint_states"]) == count - own


def test_a_folder_counts_a_recording_in_several_files_once(tmp_path: Path) -> None:
    parts = recorded(tmp_path / "parts.mcap", Split(duration=3.0), 12)
    further = [is_further_part(path, read_raw(path).fact("part")) for path in parts.paths]
    assert further == [False, *[True] * (len(further) - 1)]
    parts.path.unlink()
    assert not is_further_part(parts.paths[1], "1")  # nothing else gives what it holds


def test_files_that_are_too_small_or_would_meet_others_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        RecorderError, match="split_size is 10 bytes: it must be 0 or at least 1,000,000"
    ):
        Split(size=10)
    for wrong in (0.5, -1.0, float("nan"), float("inf")):
        with pytest.raises(RecorderError, match="must be 0 or at least 1"):
            Split(duration=wrong)
    (tmp_path / "a_1.mcap").touch()
    with pytest.raises(RecorderError, match=r"a_1\.mcap is there already"):
        check_free(tmp_path / "a.mcap", Split(duration=2.0))
    check_free(tmp_path / "a.mcap", Split())


def test_overwrite_replaces_the_parts_of_its_own_recording_only(tmp_path: Path) -> None:
    split = Split(duration=1.5)
    mine = recorded(tmp_path / "mine.mcap", split, 13)
    check_free(mine.path, split, overwrite=True)
    other = recorded(tmp_path / "other.mcap", split, 14)
    foreign = mine.paths[2]
    foreign.write_bytes(other.paths[2].read_bytes())
    with pytest.raises(RecorderError, match=r"mine_2\.mcap is no part of mine\.mcap"):
        check_free(mine.path, split, overwrite=True)
    foreign.write_text("my only copy")
    with pytest.raises(RecorderError, match="is no part of"):
        check_free(mine.path, split, overwrite=True)
    foreign.unlink()
    recorded(tmp_path / "mine_now.mcap", Split(), 15)  # no number: a recording of its own
    check_free(mine.path, split, overwrite=True)
    mine.path.unlink()
    with pytest.raises(RecorderError, match="is no part of"):
        check_free(mine.path, split, overwrite=True)
