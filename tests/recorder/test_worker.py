"""Laws: a slow disk costs messages, which are counted, and nothing else; a kill costs the last
second.
"""

from __future__ import annotations

import mmap
import os
import signal
import struct
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from ir_msgs_py.ros.testing import PATIENCE
from ir_recorder.errors import WriteError
from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.worker import Message, RecordingWorker
from ir_recorder.recording.writer import RecordingWriter

STRING = "std_msgs/msg/String"
RECORD = """
import itertools, mmap, struct, sys, threading
from pathlib import Path
from ir_recorder.format.contents import Split
from ir_recorder.recording import worker
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter

file = open(sys.argv[2], "r+b")
shown = mmap.mmap(file.fileno(), 16)  # handed over; of these with the operating system

class Session(RecordingSession):
    def flush(self):
        count = self.messages
        super().flush()
        shown[8:16] = struct.pack("<q", count)

worker.FLUSH_PERIOD = 0.02
session = Session(RecordingWriter(Path(sys.argv[1])), {}, 0, Split(size=1_000_000))
session.open_topic("/text", "std_msgs/msg/String", [])
recording = worker.RecordingWorker(session, 10_000_000)
for k in itertools.count():
    recording.write([worker.Message("/text", struct.pack("<q", k) * 100, k)])
    shown[0:8] = struct.pack("<q", k + 1)
    if k % 20 == 0:  # no faster than the file is written
        written = threading.Event()
        recording.do(lambda _, written=written: written.set())
        written.wait()
"""


class SlowSession(RecordingSession):
    """Writes when it may."""

    may = threading.Event()

    def message(self, *arguments: Any) -> None:
        self.may.wait(PATIENCE)
        super().message(*arguments)


def test_messages_that_find_no_place_are_counted_and_the_others_written(tmp_path: Path) -> None:
    SlowSession.may = threading.Event()
    session = SlowSession(RecordingWriter(tmp_path / "slow.mcap"), {}, 0)
    session.open_topic("/text", STRING, [])
    worker = RecordingWorker(session, most=100 * (900 + 100))
    worker.write(Message("/text", bytes(900), k) for k in range(250))
    assert worker.dropped == 150
    assert 0 < worker.waiting <= 100_000
    SlowSession.may.set()
    summary = worker.finish()
    assert (summary.messages, summary.dropped) == (100, 150)
    assert worker.waiting == 0
    assert read_raw(summary.path).channel("/text").log_time.tolist() == list(range(100))


def test_a_disk_that_refuses_ends_the_recording_with_its_sentence(
    tmp_path: Path, wait_for: Any
) -> None:
    writer = RecordingWriter(tmp_path / "full.mcap")
    session = RecordingSession(writer, {}, 0)
    session.open_topic("/text", STRING, [])
    worker = RecordingWorker(session, most=1_000_000)
    worker.do(
        lambda session: (_ for _ in ()).throw(writer.fail(OSError(28, "No space left on device")))
    )
    wait_for(lambda: worker._failure, what="the failure is known")
    for act in (worker.check, lambda: worker.write([Message("/text", b"", 1)]), worker.finish):
        with pytest.raises(WriteError, match="No space left on device"):
            act()


def killed(folder: Path, number: int, wait_for: Any) -> None:
    """Kill a recording process; what it had handed to the system is there, as a prefix of what it
    wrote.
    """
    folder.mkdir(exist_ok=True)
    path = folder / f"{number}.mcap"
    counts = folder / f"{number}.counts"
    counts.write_bytes(bytes(16))
    with counts.open("r+b") as file, mmap.mmap(file.fileno(), 16) as shown:
        process = subprocess.Popen(
            [sys.executable, "-c", RECORD, str(path), str(counts)], env=dict(os.environ)
        )
        try:
            wait_for(
                lambda: (
                    struct.unpack("<qq", shown)[1] > 300 + 700 * number
                    or process.poll() is not None
                ),
                what="messages are with the system",
            )
            assert process.poll() is None, "the recording process has ended by itself"
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait()
        handed, safe = struct.unpack("<qq", shown)
    raw = read_raw(path)
    found = [struct.unpack_from("<q", data)[0] for data in raw.channel("/text").messages]
    assert found == list(range(len(found)))
    assert safe <= len(found) <= handed + 1


def test_a_killed_recording_holds_what_was_flushed(tmp_path: Path, wait_for: Any) -> None:
    for number in (0, 2, 4):
        killed(tmp_path, number, wait_for)


@pytest.mark.long
def test_fifty_killed_recordings_hold_what_was_flushed(tmp_path: Path, wait_for: Any) -> None:
    for number in range(50):
        killed(tmp_path / str(number), number % 10, wait_for)
