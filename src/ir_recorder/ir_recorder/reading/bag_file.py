"""ROS 2 bags in SQLite (`.db3`) as recordings: every topic, with definitions of its type."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from ir_recorder.errors import ReadError, SchemaError
from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.reading.chunk_limits import ChunkReader, ReadLimits, TooLargeError
from ir_recorder.reading.mcap_file import RawChannel, RawRecording, in_order
from ir_values.errors import FileRefusedError, one_line
from ir_values.files import ANYWHERE, FileRoots

_OVERHEAD = 120  # bytes of memory that a message takes beside its own
_READ = ("ir_msgs/", "sensor_msgs/")  # packages of the types that are read
_DEFINITIONS = "SELECT topic_type, encoded_message_definition FROM message_definitions"


def read_bag_file(
    path: Path, roots: FileRoots = ANYWHERE, limits: ReadLimits | None = None
) -> RawRecording:
    """Everything readable in a bag; ReadError when there is nothing, or it isn't one.

    Definitions are those in the bag (ROS 2 Iron and later) or, where it has none, of the installed
    packages. A topic that could be read but whose type is nowhere defined is named in `problems`.
    """
    try:
        roots.open_to_read(path).close()
    except FileRefusedError as error:
        raise ReadError(str(error)) from error
    except OSError as error:
        raise ReadError(f"{path} can't be read: {error.strerror}") from error
    reader = _BagReader(path, ChunkReader(limits or ReadLimits()))
    try:
        source = f"{path.resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(source, uri=True)) as bag:
            channels = tuple(in_order(channel) for channel in reader.channels(bag))
    except sqlite3.Error as error:
        raise ReadError(f"{path} can't be read as a bag: {error}") from error
    if not any(channel.messages for channel in channels):
        said = "".join(f"; {problem}" for problem in reader.problems)
        raise ReadError(one_line(f"{path} holds no messages{said}"))
    return RawRecording(path, channels, (), (), tuple(map(one_line, reader.problems)))


class _BagReader:
    def __init__(self, path: Path, memory: ChunkReader) -> None:
        self._path = path
        self._memory = memory
        self._library = SchemaLibrary()
        self.problems: list[str] = []

    def channels(self, bag: sqlite3.Connection) -> Iterator[RawChannel]:
        names = {row[0] for row in bag.execute("SELECT name FROM sqlite_master")}
        own = dict(bag.execute(_DEFINITIONS)) if "message_definitions" in names else {}
        columns = {row[1] for row in bag.execute("PRAGMA table_info(topics)")}
        form = "serialization_format" if "serialization_format" in columns else "'cdr'"
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        topics = bag.execute(f"SELECT id, name, type, {form}, {qos} FROM topics ORDER BY id")
        for number, topic, kind, encoding, offered in topics.fetchall():
            text = own.get(kind) or self._installed(str(topic), str(kind))
            times, messages = self._messages(bag, int(number), str(topic))
            yield RawChannel(
                str(topic),
                str(kind),
                str(encoding),
                "ros2msg" if text else "",
                str(text),
                str(offered),
                np.array(times, dtype=np.int64),
                tuple(messages),
            )

    def _installed(self, topic: str, kind: str) -> str:
        try:
            return self._library.schema(kind).text
        except SchemaError as error:
            if kind.startswith(_READ):
                self.problems.append(f"{topic} is left out: {error}")
            return ""

    def _messages(
        self, bag: sqlite3.Connection, number: int, topic: str
    ) -> tuple[list[int], list[bytes]]:
        times: list[int] = []
        messages: list[bytes] = []
        query = "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp, id"
        try:
            for time, data in bag.execute(query, (number,)):
                if not isinstance(time, int) or not isinstance(data, bytes):
                    raise ReadError(f"{self._path}: a row of {topic} is no message")
                self._memory.count(len(data) + _OVERHEAD)
                times.append(time)
                messages.append(data)
        except sqlite3.DatabaseError as error:
            self.problems.append(f"{topic}: {len(times)} messages can be read, then: {error}")
        except TooLargeError as error:
            self.problems.append(f"{topic}: {error}")
        return times, messages
