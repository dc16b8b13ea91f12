"""Recordings are what rosbag2, Foxglove and plain MCAP readers expect."""

from __future__ import annotations

import errno
import os
import random
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

from ir_recorder.errors import RecorderError, WriteError
from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.recording.writer import RecordingWriter, messages_on_disk
from ir_values.files import FileRoots

JOINT_STATE = "sensor_msgs/msg/JointState"


def test_mcap_ros2_support_reads_every_message_back(demo_file: Path) -> None:
    with demo_file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        statistics = reader.get_summary().statistics
        decoded = sum(1 for _ in reader.iter_decoded_messages())
    assert decoded == statistics.message_count > 1000


def test_rosbags_reads_every_message_back(demo_file: Path) -> None:
    with AnyReader([demo_file]) as reader:
        topics = {connection.topic for connection in reader.connections}
        count = sum(
            reader.deserialize(raw, c.msgtype) is not None for c, _, raw in reader.messages()
        )
        assert count == reader.message_count
    assert {
        "/joint_states",
        "/ir_sim_driver/power_state",
        "/ir_program_runner/program_state",
    } <= topics


def test_chunks_messages_and_attachments_are_indexed(demo_file: Path) -> None:
    with demo_file.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
    assert len(summary.chunk_indexes) > 1
    assert all(index.message_index_offsets for index in summary.chunk_indexes)
    assert {index.name for index in summary.attachment_indexes} == {
        "cell.yaml",
        "power.yaml",
        "robot.urdf",
        "robot.yaml",
    }
    assert (
        sum(summary.statistics.channel_message_counts.values()) == summary.statistics.message_count
    )


def test_channels_carry_what_rosbag2_wants(demo_file: Path) -> None:
    with demo_file.open("rb") as stream:
        channels = make_reader(stream).get_summary().channels.values()
    for channel in channels:
        assert channel.message_encoding == "cdr"
        assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
        (profile,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert profile["reliability"] == "reliable"
        assert profile["deadline"] == {"sec": 9223372036, "nsec": 854775807}
    latched = next(c for c in channels if c.topic == "/ir_program_runner/program_state")
    assert "durability: transient_local" in latched.metadata["offered_qos_profiles"]


def test_cdr_bytes_are_kept_as_they_came(tmp_path: Path) -> None:
    data = serialize_message(JointState(name=["joint_a1"], position=[0.5]))
    writer = RecordingWriter(tmp_path / "a.mcap")
    channel = writer.register("/joint_states", JOINT_STATE)
    for k in range(3):
        writer.write(channel, 1_000_000_000 * k, data)
    summary = writer.finish()
    assert (summary.messages, summary.seconds) == (3, 2.0)
    assert read_raw(summary.path).channel("/joint_states").messages == (data,) * 3


def test_times_never_run_back_but_for_a_clock_that_was_set_back(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap")
    channel = writer.register("/joint_states", JOINT_STATE)
    for time in (5_000_000_000, 4_999_000_000, 6_000_000_000, 1_000_000_000, 1_100_000_000):
        writer.write(channel, time, b"\0\1\0\0")
    with writer.finish().path.open("rb") as file:
        messages = make_reader(file).iter_messages("/joint_states", log_time_order=False)
        times = [message.log_time for _, _, message in messages]
    assert times == [5_000_000_000, 5_000_000_000, 6_000_000_000, 1_000_000_000, 1_100_000_000]


def test_an_existing_recording_is_kept_unless_it_may_be_replaced(tmp_path: Path) -> None:
    path = RecordingWriter(tmp_path / "mine.mcap").finish().path
    before = path.read_bytes()
    with pytest.raises(RecorderError, match="is there already"):
        RecordingWriter(path)
    assert path.read_bytes() == before
    RecordingWriter(path, overwrite=True).finish()
    assert path.read_bytes()[:5] == b"\x89MCAP"


def test_overwrite_never_touches_what_is_no_recording(tmp_path: Path) -> None:
    path = tmp_path / "notes.mcap"
    path.write_text("my only copy")
    with pytest.raises(RecorderError, match="file of another kind: it is not replaced"):
        RecordingWriter(path, overwrite=True)
    assert path.read_text() == "my only copy"


def test_a_recording_stays_below_its_roots(tmp_path: Path) -> None:
    inside = tmp_path / "inside"
    outside = tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    (inside / "link").symlink_to(outside)
    roots = FileRoots.of([inside])
    for path in (
        outside / "a.mcap",
        inside / ".." / "outside" / "a.mcap",
        inside / "link" / "a.mcap",
    ):
        with pytest.raises(RecorderError, match="lies outside of the folders"):
            RecordingWriter(path, roots=roots)
    assert list(outside.iterdir()) == []
    RecordingWriter(inside / "a.mcap", roots=roots).finish()


def test_a_fifo_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    with pytest.raises(RecorderError, match="not a regular file"):
        RecordingWriter(tmp_path / "pipe.mcap", overwrite=True)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("", "empty"),
        ("a\nb.mcap", "control characters"),
        ("a\0b.mcap", "control characters"),
        ("x" * 10_000 + ".mcap", "10005 bytes, at most 200"),
        ("notes.txt", "must end in .mcap"),
        ("d/" * 3000 + "x.mcap", "more than 4000 bytes"),
        ("~nobody_of_this_name/x.mcap", "home directory"),
        ("/proc/recording.mcap", "can't be written"),
    ],
)
def test_paths_that_cannot_become_recordings_are_refused(name: str, sentence: str) -> None:
    with pytest.raises(RecorderError, match=sentence):
        RecordingWriter(name)


def test_a_full_disk_is_a_sentence_and_stays_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(WriteError, match=r"full\.mcap: No space left on device after 0 messages"):
        RecordingWriter(tmp_path / "full.mcap")
    assert list(tmp_path.iterdir()) == []
    monkeypatch.undo()
    RecordingWriter(tmp_path / "full.mcap").finish()


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_disk_that_is_full_after_the_header_leaves_what_was_there(
    overwrite: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "shift.mcap"
    if overwrite:
        RecordingWriter(path).finish()
    before = {each.name: each.read_bytes() for each in tmp_path.iterdir()}
    writer = RecordingWriter(path, overwrite=overwrite)

    def full(self: object, time: int, *rest: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("mcap.writer.Writer.add_attachment", full)
        with pytest.raises(WriteError, match="No space left"):
            writer.attach("cell.yaml", "application/yaml", b"name: here", 0)
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == before


def test_a_recording_settles_with_its_first_flush(tmp_path: Path) -> None:
    path = RecordingWriter(tmp_path / "shift.mcap").finish().path
    before = path.read_bytes()
    writer = RecordingWriter(path, overwrite=True)
    channel = writer.register("/joint_states", JOINT_STATE)
    writer.write(channel, 1, b"\0\1\0\0")
    assert path.read_bytes() == before
    writer.flush()
    assert path.read_bytes() != before
    assert writer.finish().messages == 1
    assert [each.name for each in tmp_path.iterdir()] == ["shift.mcap"]


def test_a_link_over_a_missing_folder_is_named_with_the_folder(tmp_path: Path) -> None:
    (tmp_path / "folder").symlink_to(tmp_path / "gone")
    (tmp_path / "file.mcap").symlink_to(tmp_path / "gone" / "x.mcap")
    for path in ("folder/a.mcap", "file.mcap"):
        with pytest.raises(
            RecorderError, match=r"no directory \S+/gone, to which a link"
        ) as refused:
            RecordingWriter(tmp_path / path)
        assert "make it first" in str(refused.value)
    with pytest.raises(RecorderError, match=r"no directory \S+/nowhere; make it first"):
        RecordingWriter(tmp_path / "nowhere" / "a.mcap")


def test_a_full_disk_leaves_the_recording_that_was_to_be_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "shift.mcap"
    RecordingWriter(path).finish()
    before = path.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(WriteError, match="No space left"):
            RecordingWriter(path, overwrite=True)
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == ["shift.mcap"]
    RecordingWriter(path, overwrite=True).finish()  # and nothing is locked


SECOND = """
import sys
from ir_recorder.errors import RecorderError
from ir_recorder.recording import RecordingWriter
for path in sys.argv[1:]:
    try:
        RecordingWriter(path, overwrite=True)
    except RecorderError as error:
        print(error)
"""


def names_of(path: Path) -> list[Path]:
    """The file by its name, relative to here, by links to it and by one to its folder."""
    symlink = path.with_name("symlink.mcap")
    symlink.symlink_to(path)
    hard_link = path.with_name("hard_link.mcap")
    os.link(path, hard_link)
    folder_link = path.parent.with_name(f"{path.parent.name}_link")
    folder_link.symlink_to(path.parent)
    return [path, Path(os.path.relpath(path)), symlink, hard_link, folder_link / path.name]


def test_a_second_writer_of_a_file_is_refused_by_whatever_name(tmp_path: Path) -> None:
    """In this process and in another one; a file that is new, and one that is replaced."""
    writers = []
    others = []
    for kind in ("new", "replaced"):
        path = tmp_path / kind / "a.mcap"
        path.parent.mkdir()
        if kind == "replaced":
            RecordingWriter(path).finish()
        writers.append(RecordingWriter(path, overwrite=kind == "replaced"))
        others += names_of(path)
    for other in others:
        with pytest.raises(RecorderError, match="is being written by another recorder"):
            RecordingWriter(other, overwrite=True)
    words = [sys.executable, "-c", SECOND, *map(str, others)]
    refused = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(refused) == len(others)
    assert all("is being written by another recorder" in sentence for sentence in refused)
    for writer in writers:
        channel = writer.register("/joint_states", JOINT_STATE)
        writer.write(channel, 0, b"\0\1\0\0")
        assert writer.finish().messages == 1
    for other in others:
        RecordingWriter(other, overwrite=True).finish()


@pytest.mark.parametrize("pairs", [20, pytest.param(200, marks=pytest.mark.long)])
def test_of_a_pair_of_writers_one_is_refused_and_nothing_is_lost(
    tmp_path: Path, pairs: int
) -> None:
    """Both begin at once, of one file with and without an older one: one writes and the other is
    refused, and what SUCCESS counted is in the file.
    """
    written = 0
    refused = 0
    schemas = SchemaLibrary()
    for pair in range(pairs):
        path = tmp_path / f"{pair}.mcap"
        if pair % 2:
            RecordingWriter(path).finish()
        start = threading.Barrier(2)
        done: list[int] = []

        def record(
            path: Path = path, start: threading.Barrier = start, done: list[int] = done
        ) -> None:
            start.wait()
            try:
                writer = RecordingWriter(path, schemas, overwrite=True)
            except RecorderError:
                done.append(-1)
                start.wait()
                return
            channel = writer.register("/joint_states", JOINT_STATE)
            for time in range(5):
                writer.write(channel, time, b"\0\1\0\0")
            start.wait()  # only now may the file be free
            done.append(writer.finish().messages)

        threads = [threading.Thread(target=record) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(timeout=30.0)
        assert sorted(done) == [-1, 5]
        refused += 1
        written += messages_on_disk(path)
    assert refused == pairs
    assert written == 5 * pairs


def test_what_the_disk_holds_decides_about_success(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap")
    channel = writer.register("/joint_states", JOINT_STATE)
    writer.write(channel, 0, b"\0\1\0\0")
    writer.flush()
    with (tmp_path / "a.mcap").open("r+b") as other:  # one that takes no lock
        other.truncate(10)
    with pytest.raises(WriteError, match="not those that were written"):
        writer.finish()


@pytest.mark.parametrize("end", ["flush", "finish"])
@pytest.mark.parametrize("happens", ["deleted", "replaced", "folder"])
def test_a_file_that_is_gone_is_no_recording(tmp_path: Path, end: str, happens: str) -> None:
    folder = tmp_path / "shift"
    folder.mkdir()
    writer = RecordingWriter(folder / "gone.mcap")
    if happens == "folder":
        shutil.rmtree(folder)
    else:
        (folder / "gone.mcap").unlink()
    if happens == "replaced":
        (folder / "gone.mcap").write_bytes(b"")
    with pytest.raises(
        WriteError, match=r"gone\.mcap: it was deleted, moved or replaced .* recording has ended"
    ):
        getattr(writer, end)()


@pytest.mark.parametrize("seed", range(20))
def test_no_byte_that_another_process_changed_is_a_success(tmp_path: Path, seed: int) -> None:
    """Wherever it is: in a chunk, an attachment, a record between them."""
    generator = random.Random(seed)
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path)
    channel = writer.register("/joint_states", JOINT_STATE)
    writer.attach("cell.yaml", "application/yaml", generator.randbytes(5000), 0)
    for k in range(40):
        writer.write(channel, 1_000_000_000 + k, generator.randbytes(2000))
    writer.flush()
    at = generator.randrange(path.stat().st_size)
    with path.open("r+b") as other:
        other.seek(at)
        (before,) = other.read(1)
        other.seek(at)
        other.write(bytes([before ^ generator.randrange(1, 256)]))
    with pytest.raises(WriteError, match="not those that were written"):
        writer.finish()


def test_a_writer_that_failed_refuses_further_messages(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap")
    channel = writer.register("/joint_states", JOINT_STATE)
    writer.fail(OSError(28, "No space left on device"))
    with pytest.raises(WriteError, match="No space left"):
        writer.write(channel, 0, b"\0\1\0\0")
    with pytest.raises(WriteError, match="No space left"):
        writer.finish()


def test_finishing_twice_changes_nothing(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap")
    first = writer.finish()
    size = first.path.stat().st_size
    assert writer.finish() == first
    assert first.path.stat().st_size == size
