"""Output files: written beside their place and then moved there, and locked while they grow.

A disk that fills up, a process that is killed or a power cut leaves the old file as it was. Raises
OSError, as `open` does; nothing is left beside the place then.
"""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any
from weakref import WeakValueDictionary

_SUFFIX = ".part"


def write_file(path: str | Path, content: str | bytes, new: bool = False) -> None:
    """Puts a text (UTF-8) or bytes in place of a file, whole or not at all.

    Links are followed: the file that they lead to is replaced. new: FileExistsError where one is.
    """
    with replacing_bytes(path, new) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


@contextmanager
def replacing_bytes(path: str | Path, new: bool = False) -> Iterator[IO[bytes]]:
    """A stream whose bytes are the file once the block has ended; unchanged where it raises."""
    with _replacing(path, new, "wb") as stream:
        yield stream


@contextmanager
def replacing_text(path: str | Path) -> Iterator[IO[str]]:
    """As `replacing_bytes`, for text in UTF-8 whose line ends stay as they are written."""
    with _replacing(path, False, "w", encoding="utf-8", newline="") as stream:
        yield stream


@contextmanager
def _replacing(path: str | Path, new: bool, mode: str, **options: Any) -> Iterator[IO[Any]]:
    """A stream into a file beside `path`, which takes its place at the end."""
    place = Path(os.path.realpath(path))
    before = _status(place)
    if before is not None and new:
        raise FileExistsError(errno.EEXIST, "File exists", str(path))
    if before is not None and not stat.S_ISREG(before.st_mode):
        if stat.S_ISDIR(before.st_mode):
            raise IsADirectoryError(errno.EISDIR, "Is a directory", str(path))
        with open(place, mode, **options) as stream:  # a terminal or a pipe: nothing to replace
            yield stream
        return
    if before is not None and not os.access(place, os.W_OK):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))  # as if it were opened
    descriptor, name = beside(place)
    try:
        with os.fdopen(descriptor, mode, **options) as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        if before is not None:
            os.chmod(name, stat.S_IMODE(before.st_mode))
        if new:
            _move_where_none_is(name, place)
        else:
            os.replace(name, place)
    except BaseException:
        with suppress(FileNotFoundError):
            os.unlink(name)
        raise
    sync_folder(place.parent)


def beside(place: Path) -> tuple[int, str]:
    """A new file in the folder of `place`, hidden, with the rights of a new file: its descriptor
    and name.
    """
    name = str(place.with_name(f".{place.name[:100]}.{os.urandom(6).hex()}{_SUFFIX}"))
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    return os.open(name, flags, 0o666), name  # less what the umask takes


def sync_folder(folder: Path) -> None:
    """Makes names in a folder last; some file systems can't."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _move_where_none_is(name: str, place: Path) -> None:
    try:
        os.link(name, place)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links: the name is taken first
        os.close(os.open(place, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
        os.replace(name, place)
        return
    os.unlink(name)


def _status(place: Path) -> os.stat_result | None:
    try:
        return os.stat(place)
    except FileNotFoundError:
        return None


class FileLock:
    """The right to write a file, by its inode: all names of it lead to the same lock.

    Held until it is released, or its file is closed. BlockingIOError where another process, or
    another part of this one, holds it.
    """

    def __init__(self, descriptor: int) -> None:
        status = os.fstat(descriptor)
        self._key = (status.st_dev, status.st_ino)
        if self._key in _held:
            raise BlockingIOError(errno.EAGAIN, "it is being written")
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            pass  # a file system without locks: those of this process remain
        _held[self._key] = self

    def release(self) -> None:
        """Gives it up in this process; the system's lock ends where the file is closed."""
        if _held.get(self._key) is self:
            del _held[self._key]


# beside the system's locks, which some file systems keep for whole processes only
_held: WeakValueDictionary[tuple[int, int], FileLock] = WeakValueDictionary()
