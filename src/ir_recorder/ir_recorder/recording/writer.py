"""Writes recordings that rosbag2, Foxglove and plain MCAP readers accept.

Profile `ros2`, one `ros2msg` schema per type, CDR bytes as they came from the middleware, chunks
with indexes and a statistics record. Nothing but CDR channels: `ros2 bag play` refuses a file with
a JSON channel, so everything else (cell file, URDF, facts) goes into attachments and metadata
records.
"""

from __future__ import annotations

import errno
import os
import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import BufferedWriter, FileIO
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from ir_recorder.errors import LostFileError, RecorderError, WriteError
from ir_recorder.format.qos import QosOffer, offers_to_yaml
from ir_recorder.format.schemas import SchemaLibrary
from ir_values.errors import FileRefusedError
from ir_values.files import ANYWHERE, FileRoots, check_kind, opened
from ir_values.output_files import FileLock, beside, sync_folder

CHUNK_SIZE = 256 * 1024  # bytes: about 1.5 s of a cell; what a power cut may cost
REORDERED = 1_000_000_000  # ns: topics are polled every 20 ms; more is a clock that was set back
_READ = 1 << 20  # bytes that are read back at a time
_PATH_MAX = 4000  # bytes; systems end at 4096
_NAME_MAX = 200  # bytes of a file's name; file systems end at 255


@dataclass(frozen=True)
class RecordingSummary:
    """What a finished recording holds: its file (the first, where `paths` has several), the number
    of messages, the time they span [s], how many messages the disk was too slow for, how many never
    arrived, and why the last file was not split further ("": it was not due).
    """

    path: Path
    messages: int
    seconds: float
    paths: tuple[Path, ...] = ()
    dropped: int = 0
    lost: int = 0
    blocked: str = ""


class RecordingWriter:
    """One MCAP file being written; times are nanoseconds of the node's clock.

    Raises RecorderError when the file can't be opened, WriteError as soon as the storage refuses;
    after a WriteError the writer is closed and further calls raise the same error again. The first
    `flush` settles the file: one that fails before is deleted, and an older recording is kept.
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
        self._file = RecordingFile(self.path, overwrite, roots)
        self._writer = Writer(
            self._file.stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD
        )
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
            self._file.sync()  # a full disk shows at once

    @property
    def messages(self) -> int:
        """How many messages were written."""
        return self._messages

    @property
    def size(self) -> int:
        """Bytes of the file, without the chunk that is being filled."""
        return self._file.stream.tell()

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

    def write(self, channel: int, log_time: int, data: bytes) -> None:
        """Appends one message's CDR bytes.

        Players read in file order, so a time that runs back by less than REORDERED is set to the
        newest; more is a clock that was set back, and kept.
        """
        if 0 < self._newest - log_time < REORDERED:
            log_time = self._newest
        self._newest = log_time
        with self._storage():
            self._writer.add_message(channel, log_time, data, log_time, self._sequence[channel])
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
            if not self._file.settled:
                self._file.settle()

    def finish(self) -> RecordingSummary:
        """Writes indexes and statistics, puts all on the disk, and closes the file.

        Every byte is read back, about a second per GB, and the summary counts what the file says
        that it holds; WriteError where either is not what was written. A second call changes
        nothing.
        """
        if not self._finished:
            with self._storage():
                self._writer.finish()  # type: ignore[no-untyped-call]
                self._check_there()
                self._file.settle()
                self._file.check_bytes()
                held = self._file.messages_on_disk()
                if held != self._messages:
                    raise OSError(errno.EIO, f"it holds {held} messages of {self._messages}")
                self._file.close()
            self._finished = True
        first = self._last if self._first is None else self._first
        return RecordingSummary(self.path, self._messages, (self._last - first) * 1e-9)

    def discard(self) -> None:
        """Close a file that nothing was written into; it is deleted."""
        self._file.close()

    def _check_there(self) -> None:
        """OSError for a file that was deleted or replaced: it takes whatever is written, and
        is never found.
        """
        if not self._file.is_there():
            raise OSError(errno.ENOENT, "it was deleted, moved or replaced by another file")

    def _storage(self) -> _Storage:
        if self._failure is not None:
            raise self._failure
        return _Storage(self)

    def fail(self, error: OSError) -> WriteError:
        """Closes the writer for good after the storage refused; gives the error to raise."""
        kind = WriteError if self._file.is_there() else LostFileError
        self._failure = kind(
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
    """An absolute path that may become a recording; RecorderError names what is wrong with it."""
    text = str(path)
    if not text.isprintable() or not text:
        raise RecorderError(f"path {text[:80]!r}: empty, or with control characters")
    name = Path(text).name
    if len(name.encode()) > _NAME_MAX:
        raise RecorderError(
            f"the file's name has {len(name.encode())} bytes, at most {_NAME_MAX} are taken"
        )
    if Path(text).suffix != ".mcap":
        raise RecorderError(f"path {text[:200]!r} must end in .mcap")
    if len(text.encode(errors="replace")) > _PATH_MAX:
        raise RecorderError(f"the path has more than {_PATH_MAX} bytes")
    try:
        return Path(text).expanduser().absolute()
    except RuntimeError as error:  # a user without a home
        raise RecorderError(f"path {text[:80]!r}: {error}") from error


class _SummedWriter(BufferedWriter):
    """A stream that is appended to; sum: the check sum (CRC-32) of all its bytes."""

    sum = 0

    def write(self, data: Any) -> int:
        """Append bytes."""
        self.sum = zlib.crc32(data, self.sum)
        return super().write(data)


class RecordingFile:
    """The file of a recording below `roots`, locked while it grows.

    With `overwrite` it may take the place of a recording, never of anything else: it is written
    beside, and `settle` moves it there. RecorderError when it can't be opened, or is being written.
    """

    def __init__(self, path: Path, overwrite: bool, roots: FileRoots) -> None:
        self._new: Path | None = None  # the file until it has settled
        self._replaced: BinaryIO | None = None
        self._locks: list[FileLock] = []
        try:
            self._place = roots.inside(path)
            folder = self._place.parent
            if not folder.is_dir():
                link = "" if folder == path.parent else ", to which a link in it leads"
                raise RecorderError(
                    f"{path} can't be written: there is no directory {folder}{link}; make it first"
                )
            self.stream = _SummedWriter(FileIO(self._opened(path, overwrite), "wb"))
        except FileRefusedError as error:
            raise RecorderError(str(error)) from error
        except FileExistsError as error:
            raise RecorderError(
                f"{path} is there already; choose another path or set overwrite"
            ) from error
        except BlockingIOError as error:
            raise RecorderError(
                f"{path} is being written by another recorder: stop that one, or choose another "
                "path"
            ) from error
        except OSError as error:
            raise RecorderError(f"{path} can't be written: {error.strerror}") from error

    def _opened(self, path: Path, overwrite: bool) -> int:
        """A descriptor of the file to write: a new one at its place, or beside an older one."""
        while True:
            try:
                flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_NOFOLLOW
                descriptor = self._locked(os.open(self._place, flags, 0o666))
            except FileExistsError:
                if not overwrite:
                    raise
            else:
                self._new = self._place
                return descriptor
            try:
                older = os.fdopen(opened(self._place, os.O_RDWR, path), "r+b")
            except FileNotFoundError:
                continue  # it went meanwhile
            if self._may_replace(older, path):
                break
            older.close()
        self._replaced = older
        descriptor, name = beside(self._place)
        self._new = Path(name)
        return self._locked(descriptor)

    def _may_replace(self, older: BinaryIO, path: Path) -> bool:
        """Locks an older recording; False where it isn't the one at that place any more."""
        try:
            check_kind(older.read(len(MCAP0_MAGIC)), MCAP0_MAGIC, path)
            self._locked(older.fileno())
        except BaseException:
            older.close()
            raise
        if self.is_there(older.fileno()):
            return True
        self._locks.pop().release()
        return False

    def _locked(self, descriptor: int) -> int:
        self._locks.append(FileLock(descriptor))
        return descriptor

    @property
    def settled(self) -> bool:
        """Whether it stays, at its place."""
        return self._new is None

    def is_there(self, descriptor: int | None = None) -> bool:
        """Whether its name leads to the file (to that descriptor's) still."""
        return self._leads(
            self._new or self._place, self.stream.fileno() if descriptor is None else descriptor
        )

    @staticmethod
    def _leads(path: Path, descriptor: int) -> bool:
        try:
            return os.path.samestat(os.stat(path), os.fstat(descriptor))
        except (FileNotFoundError, NotADirectoryError):
            return False

    def sync(self) -> None:
        """Puts what was written so far on the disk."""
        self.stream.flush()
        os.fsync(self.stream.fileno())

    def settle(self) -> None:
        """Puts what was written so far on the disk, and in place of the older recording."""
        self.sync()
        if self._new is not None and self._new != self._place:
            os.replace(self._new, self._place)
        self._new = None
        sync_folder(self._place.parent)
        if self._replaced is not None:
            self._replaced.close()
            self._replaced = None

    def check_bytes(self) -> None:
        """OSError where the bytes of the file aren't those that were written: somebody else wrote
        into it, or the storage lost them.
        """
        found = 0
        with ANYWHERE.open_to_read(self._place) as stream:
            while block := stream.read(_READ):
                found = zlib.crc32(block, found)
        if found != self.stream.sum:
            raise OSError(errno.EIO, "its bytes are not those that were written")

    def messages_on_disk(self) -> int:
        """The number of messages that the file says it holds; OSError where it can't be read
        back.
        """
        return messages_on_disk(self._place)

    def close(self) -> None:
        """Closes it and gives up its lock; one that never settled is deleted."""
        try:
            if self._new is not None and self._leads(self._new, self.stream.fileno()):
                with suppress(OSError):
                    os.unlink(self._new)
            self._new = None
            self.stream.close()
        finally:
            if self._replaced is not None:
                self._replaced.close()
                self._replaced = None
            for lock in self._locks:
                lock.release()


def messages_on_disk(path: Path) -> int:
    """The number of messages of a finished recording; OSError where it can't be read."""
    try:
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
    except (McapError, ValueError, struct.error) as error:
        raise OSError(errno.EIO, f"it can't be read back: {error}") from error
    if summary is None or summary.statistics is None:
        raise OSError(errno.EIO, "it can't be read back: it has no statistics")
    return summary.statistics.message_count


OpenWriter = Callable[[str, bool, FileRoots], RecordingWriter]


def open_writer(path: str, overwrite: bool, roots: FileRoots) -> RecordingWriter:
    """The writer of a file below `roots`; a test may hand in another."""
    return RecordingWriter(path, overwrite=overwrite, roots=roots)
