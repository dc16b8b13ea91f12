"""Writes recordings that rosbag2, Foxglove and plain MCAP readers accept.

Profile `ros2`, one `ros2msg` schema per type, CDR bytes as they came from the middleware, chunks
with indexes and a statistics record. Nothing but CDR channels: `ros2 bag play` refuses a file with
a JSON channel, so everything else (cell file, URDF, facts) goes into attachments and metadata
records.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from ir_msgs_py.errors import FileRefusedError
from ir_msgs_py.file_roots import ANYWHERE, FileRoots
from ir_recorder.errors import PathError, WriteError
from ir_recorder.format.qos import QosOffer, offers_to_yaml
from ir_recorder.format.schemas import SchemaLibrary

CHUNK_SIZE = 256 * 1024  # bytes: about 1.5 s of a cell; what a power cut may cost
REORDERED = 1_000_000_000  # ns: topics are polled every 20 ms; more is a clock that was set back
_PATH_MAX = 4000  # bytes; systems end at 4096
_NAME_MAX = 200  # bytes of a file's name; file systems end at 255


@dataclass(frozen=True)
class RecordingSummary:
    """What a finished recording holds: its file (the first, where `paths` has several), the number
    of messages, the time they span [s], and how many messages the disk was too slow for.
    """

    path: Path
    messages: int
    seconds: float
    paths: tuple[Path, ...] = ()
    dropped: int = 0


class RecordingWriter:
    """One MCAP file being written; times are nanoseconds of the node's clock.

    Raises PathError when the file can't be opened and WriteError as soon as the storage refuses;
    after a WriteError the writer is closed and further calls raise the same error again.
    """

    def __init__(
        self,
        path: str | Path,
        schemas: SchemaLibrary | None = None,
        overwrite: bool = False,
        roots: FileRoots = ANYWHERE,
    ) -> None:
        self.path = checked_path(path)
        self._schemas = schemas or SchemaLibrary()
        self._file = _open(self.path, overwrite, roots)
        self._writer = Writer(self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        self._schema_ids: dict[str, int] = {}
        self._sequence: dict[int, int] = {}
        self._first: int | None = None
        self._last = 0
        self._newest = 0
        self._messages = 0
        self._failure: WriteError | None = None
        self._finished = False
        with self._storage():
            self._writer.start(profile="ros2", library="ir_recorder")
            self._file.flush()  # a full disk shows at once

    @property
    def messages(self) -> int:
        """How many messages were written."""
        return self._messages

    @property
    def size(self) -> int:
        """Bytes of the file, without the chunk that is being filled."""
        return self._file.tell()

    def register(self, topic: str, type_name: str, offers: Sequence[QosOffer] = ()) -> int:
        """Opens a channel and returns its number; SchemaError when the type isn't installed."""
        schema = self._schemas.schema(type_name)
        with self._storage():
            if type_name not in self._schema_ids:
                self._schema_ids[type_name] = self._writer.register_schema(
                    type_name, "ros2msg", schema.text.encode()
                )
            channel = self._writer.register_channel(
                topic,
                "cdr",
                self._schema_ids[type_name],
                {
                    "offered_qos_profiles": offers_to_yaml(offers),
                    "topic_type_hash": schema.type_hash,
                },
            )
        self._sequence[channel] = 0
        return channel

    def write(
        self, channel: int, log_time: int, data: bytes, publish_time: int | None = None
    ) -> None:
        """Appends one message's CDR bytes.

        Players read in file order, so a time that runs back by less than REORDERED is set to the
        newest; more is a clock that was set back, and kept.
        """
        if 0 < self._newest - log_time < REORDERED:
            log_time = self._newest
        self._newest = log_time
        with self._storage():
            self._writer.add_message(
                channel,
                log_time,
                data,
                log_time if publish_time is None else publish_time,
                self._sequence[channel],
            )
        self._sequence[channel] += 1
        self._messages += 1
        self._first = log_time if self._first is None else min(self._first, log_time)
        self._last = max(self._last, log_time)

    def attach(self, name: str, media_type: str, data: bytes, time: int) -> None:
        """Puts a file beside the messages (cell, URDF)."""
        with self._storage():
            self._writer.add_attachment(time, time, name, media_type, data)

    def facts(self, name: str, facts: Mapping[str, str]) -> None:
        """Writes a metadata record: short texts by name."""
        with self._storage():
            self._writer.add_metadata(name, dict(facts))

    def flush(self) -> None:
        """Hands all messages so far to the operating system; they end a chunk."""
        with self._storage():
            self._writer.flush()  # type: ignore[no-untyped-call]
            self._check_there()

    def finish(self) -> RecordingSummary:
        """Writes indexes and statistics and closes the file. A second call changes nothing."""
        if not self._finished:
            with self._storage():
                self._writer.finish()  # type: ignore[no-untyped-call]
                self._file.flush()
                os.fsync(self._file.fileno())
                self._check_there()
                self._file.close()
            self._finished = True
        first = self._last if self._first is None else self._first
        return RecordingSummary(self.path, self._messages, (self._last - first) * 1e-9)

    def _check_there(self) -> None:
        """A file that was deleted takes whatever is written, and nobody will find it."""
        try:
            there = os.path.samestat(os.stat(self.path), os.fstat(self._file.fileno()))
        except FileNotFoundError:
            there = False
        if not there:
            raise OSError(errno.ENOENT, "it was deleted, moved or replaced by another file")

    def _storage(self) -> _Storage:
        if self._failure is not None:
            raise self._failure
        return _Storage(self)

    def fail(self, error: OSError) -> WriteError:
        """Closes the writer for good after the storage refused; gives the error to raise."""
        self._failure = WriteError(
            f"{self.path}: {error.strerror or error} after {self._messages} messages; recording "
            "has ended"
        )
        with suppress(OSError):  # closing flushes, and the storage refuses still
            self._file.close()
        return self._failure


class _Storage:
    """Translates what the storage raises, where it enters."""

    def __init__(self, writer: RecordingWriter) -> None:
        self._owner = writer

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: object
    ) -> None:
        if isinstance(error, OSError):
            raise self._owner.fail(error) from error


def checked_path(path: str | Path) -> Path:
    """An absolute path that may become a recording; PathError names what is wrong with it."""
    text = str(path)
    if not text.isprintable() or not text:
        raise PathError(f"path {text[:80]!r}: empty, or with control characters")
    name = Path(text).name
    if len(name.encode()) > _NAME_MAX:
        raise PathError(
            f"the file's name has {len(name.encode())} bytes, at most {_NAME_MAX} are taken"
        )
    if Path(text).suffix != ".mcap":
        raise PathError(f"path {text[:200]!r} must end in .mcap")
    if len(text.encode(errors="replace")) > _PATH_MAX:
        raise PathError(f"the path has more than {_PATH_MAX} bytes")
    try:
        return Path(text).expanduser().absolute()
    except RuntimeError as error:  # a user without a home
        raise PathError(f"path {text[:80]!r}: {error}") from error


def _open(path: Path, overwrite: bool, roots: FileRoots) -> BinaryIO:
    """The file, below `roots`; with `overwrite` in place of a recording, never of anything else."""
    try:
        roots.inside(path)
    except FileRefusedError as error:
        raise PathError(str(error)) from error
    if not path.parent.is_dir():
        raise PathError(
            f"{path} can't be written: there is no directory {path.parent}; make it first"
        )
    try:
        return roots.open_to_write(path, MCAP0_MAGIC if overwrite else None)
    except FileRefusedError as error:
        raise PathError(str(error)) from error
    except FileExistsError as error:
        raise PathError(f"{path} is there already; choose another path or set overwrite") from error
    except OSError as error:
        raise PathError(f"{path} can't be written: {error.strerror}") from error


OpenWriter = Callable[[str, bool, FileRoots], RecordingWriter]


def open_writer(path: str, overwrite: bool, roots: FileRoots) -> RecordingWriter:
    """The writer of a file below `roots`; a test may hand in another."""
    return RecordingWriter(path, overwrite=overwrite, roots=roots)
