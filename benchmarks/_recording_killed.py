"""Recordings of a process that is killed: how many seconds of messages are missing."""

from __future__ import annotations

import random
import struct
import subprocess
import sys
import time
from pathlib import Path

from ir_recorder.reading.mcap_file import read_raw

WRITER = """
import sys, time
from ir_recorder.recording import RecordingSession, RecordingWriter
from ir_recorder.recording.worker import Message, RecordingWorker

session = RecordingSession(RecordingWriter(sys.argv[1]), {}, time.monotonic_ns())
session.open_topic("/text", "std_msgs/msg/String", [])
worker = RecordingWorker(session, 10_000_000)
while True:
    now = time.monotonic_ns()
    worker.write([Message("/text", now.to_bytes(8, "little") * 50, now)])
    time.sleep(0.001)
"""


def seconds_lost(folder: Path, number: int) -> float:
    """Seconds between the kill and the last message that is in the file."""
    path = folder / f"killed_{number}.mcap"
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)])
    try:
        while not path.exists() or path.stat().st_size < 20_000:
            time.sleep(0.01)
        time.sleep(random.Random(number).uniform(0.0, 1.5))
    finally:
        process.kill()
        killed = time.monotonic_ns()
        process.wait()
    channel = read_raw(path).channel("/text")
    assert channel is not None
    (last,) = struct.unpack_from("<q", channel.messages[-1])
    return float(killed - last) * 1e-9
