"""A thread of its own for a recording: a disk that is slow or compresses holds up nobody.

What waits is bounded in bytes; messages beyond are dropped and counted. What waited reaches the
operating system within FLUSH_PERIOD, so that a recorder that is killed leaves a file that can be
read up to there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from queue import Empty, SimpleQueue
from threading import Thread
from typing import NamedTuple

from ir_recorder.errors import RecorderError, WriteError
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingSummary

FLUSH_PERIOD = 0.5  # s; with the time between two looks at the topics less than a second
_OVERHEAD = 100  # bytes of memory that a message takes beside its own

Act = Callable[[RecordingSession], None]


class Message(NamedTuple):
    """One to be written: its topic, its CDR, and when it was received [ns]."""

    topic: str
    data: bytes
    time: int


class RecordingWorker:
    """Feeds a session from a queue of at most `most` bytes.

    All methods but `finish` return at once and raise the WriteError that ended the recording, if
    one did.
    """

    def __init__(self, session: RecordingSession, most: int) -> None:
        self._session = session
        self._most = most
        self._queue: SimpleQueue[Act | list[Message] | None] = SimpleQueue()
        self._put = 0  # bytes; each is written by one thread only
        self._taken = 0
        self._failure: WriteError | None = None
        self._summary: RecordingSummary | None = None
        self.dropped = 0
        self._thread = Thread(target=self._work, name="recording", daemon=True)
        self._thread.start()

    @property
    def session(self) -> RecordingSession:
        """What is being written, to look at."""
        return self._session

    @property
    def waiting(self) -> int:
        """Bytes of messages that wait."""
        return self._put - self._taken

    def check(self) -> None:
        """Raise the WriteError that ended the recording."""
        if self._failure is not None:
            raise self._failure

    def do(self, act: Act) -> None:
        """Act on the session after what waits."""
        self.check()
        self._queue.put(act)

    def write(self, messages: Iterable[Message]) -> None:
        """Append messages of open topics; those that find no place are dropped."""
        self.check()
        batch = []
        for message in messages:
            size = len(message.data) + _OVERHEAD
            if self._put + size - self._taken > self._most:
                self.dropped += 1
                continue
            self._put += size
            batch.append(message)
        if batch:
            self._queue.put(batch)

    def finish(self) -> RecordingSummary:
        """Write what waits, close the file and say what it holds."""
        self._queue.put(None)
        self._thread.join()
        self.check()
        assert self._summary is not None  # the thread ends with a summary or a failure
        return replace(self._summary, dropped=self.dropped)

    def _work(self) -> None:
        flushed = time.monotonic()
        try:
            while self._next(max(flushed + FLUSH_PERIOD - time.monotonic(), 0.0)):
                if time.monotonic() - flushed >= FLUSH_PERIOD:
                    self._session.flush()
                    flushed = time.monotonic()
            self._summary = self._session.finish()
        except WriteError as error:
            self._failure = error
        except (RecorderError, OSError) as error:  # the next file can't be opened
            self._failure = WriteError(f"{self._session.path}: {error}; recording has ended")

    def _next(self, patience: float) -> bool:
        """Do what waits next, for at most `patience` [s]; False at the end."""
        try:
            job = self._queue.get(timeout=patience)
        except Empty:
            return True
        if job is None:
            return False
        if isinstance(job, list):
            for message in job:
                self._session.message(message.topic, message.data, message.time)
                self._taken += len(message.data) + _OVERHEAD
        else:
            job(self._session)
        return True
