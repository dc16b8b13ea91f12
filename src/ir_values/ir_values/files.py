"""Files that are read and written: regular, of bounded size, UTF-8, below allowed folders.

A path may come from a request or from another file, so it is resolved first, held against the
folders, and opened without following a link and without waiting for a FIFO. Refusals name the path,
never what the file holds.
"""

from __future__ import annotations

import codecs
import os
import stat
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ir_values.errors import DescriptionFileError, FileRefusedError, InvalidValueError, shown
from ir_values.output_files import write_file

_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_HEAD = 64  # bytes, in which every second one is zero where Latin letters stand in UTF-16


def read_regular_file(path: Path, limit: int) -> bytes:
    """Return the content of a regular file of at most `limit` bytes; never blocks on a FIFO or
    device. Raises InvalidValueError for others.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InvalidValueError(
            f"file {shown(str(path), 200)} can't be opened: {reason}"
        ) from error
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise InvalidValueError(f"file {shown(str(path), 200)} is not a regular file")
        if status.st_size > limit:
            raise InvalidValueError(
                f"file {shown(str(path))} has {status.st_size} bytes, must be at most {limit} bytes"
            )
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            return file.read(limit)
    finally:
        os.close(descriptor)


def text_of(content: bytes, source: str, error: type[DescriptionFileError]) -> str:
    """Return the text of a file's content; raise `error` with the line of the first byte that is
    none.
    """
    if is_utf16(content):
        raise error(source, 1, "the file is UTF-16 text, must be UTF-8: save it with that encoding")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as refused:
        line = content.count(b"\n", 0, refused.start) + 1
        raise error(
            source, line, f"byte 0x{content[refused.start]:02x} is not UTF-8 text"
        ) from refused


def is_utf16(content: bytes) -> bool:
    """Whether text begins with the mark of UTF-16 or, without it, with Latin letters of two
    bytes.
    """
    zeros = [content[odd:_HEAD:2].count(0) for odd in (0, 1)]
    return content.startswith(_MARKS) or (
        min(zeros) == 0 and 4 * max(zeros) > min(len(content), _HEAD)
    )


def is_path(text: str) -> bool:
    """Whether a text is the path of a file, and not the name of something bundled."""
    return os.sep in text or text.endswith((".yaml", ".yml"))


def inside(folder: Path | None, name: str) -> Path:
    """The path of a YAML file that another file names, relative to that file's folder; nothing
    leads out. Raises InvalidValueError for a path that leads elsewhere.
    """
    if folder is None:
        raise InvalidValueError(
            f"file {shown(name)} can't be named in a text; write out what it says"
        )
    path = Path(name)
    if "://" in name or "\\" in name or path.is_absolute() or ".." in path.parts:
        raise InvalidValueError(
            f"file {shown(name)} must stand beside this file or below, named relative to it, "
            "without '..'"
        )
    resolved = (folder / path).resolve()
    if not resolved.is_relative_to(folder.resolve()):
        raise InvalidValueError(f"file {shown(name)} leads out of the folder of this file")
    return resolved


ENVIRONMENT = "IR_FILE_ROOTS"
"""Folders, separated as in PATH, for nodes and commands that are given none."""
_SAFE = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC


@dataclass(frozen=True)
class FileRoots:
    """Folders below which files may be read and written."""

    folders: tuple[Path, ...]

    @classmethod
    def of(cls, folders: Iterable[str | Path] = ()) -> FileRoots:
        """The given folders; where there are none those of IR_FILE_ROOTS, else the working
        folder.
        """
        given = [folder for folder in folders if str(folder)]
        named = [folder for folder in os.environ.get(ENVIRONMENT, "").split(os.pathsep) if folder]
        return cls(tuple(_resolved(folder) for folder in given or named or [Path.cwd()]))

    def inside(self, path: str | Path) -> Path:
        """The path with all links resolved; FileRefusedError where it lies outside of the
        folders.
        """
        real = _resolved(path)
        if any(real.is_relative_to(folder) for folder in self.folders):
            return real
        known = ", ".join(str(folder) for folder in self.folders)
        raise FileRefusedError(
            f"{_named(path)} lies outside of the folders that may be used: {known} "
            f"(more by {ENVIRONMENT}, a node's parameter roots, or --root where a command has it)"
        )

    def open_to_read(self, path: str | Path) -> BinaryIO:
        """A regular file; FileRefusedError for another kind or place, OSError where it can't be
        opened.
        """
        return os.fdopen(opened(self.inside(path), os.O_RDONLY, path), "rb")

    def write(self, path: str | Path, content: bytes, replaces: bytes | None = None) -> None:
        """A new file, or one in place of a file that is empty or starts with the bytes `replaces`:
        whole, or not at all.

        Raises FileExistsError where a file is there and `replaces` is None, FileRefusedError for a
        file of another kind or place: nothing of it is touched then.
        """
        real = self.inside(path)
        if replaces is not None:
            try:
                with os.fdopen(opened(real, os.O_RDWR, path), "rb") as stream:
                    check_kind(stream.read(len(replaces)), replaces, path)
            except FileNotFoundError:
                replaces = None
        write_file(real, content, new=replaces is None)


ANYWHERE = FileRoots((Path("/"),))
"""For a script that chooses its files itself."""


def check_kind(start: bytes, replaces: bytes, path: str | Path) -> None:
    """FileRefusedError where a file's first bytes are those of another kind."""
    if start not in (b"", replaces):
        raise FileRefusedError(f"{_named(path)} is a file of another kind: it is not replaced")


def opened(real: Path, flags: int, path: str | Path) -> int:
    """The descriptor of a regular file by a path whose links are resolved; FileRefusedError for
    another kind.
    """
    descriptor = os.open(real, flags | _SAFE)
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return descriptor
    os.close(descriptor)
    raise FileRefusedError(f"{_named(path)} is not a regular file")


def _resolved(path: str | Path) -> Path:
    try:
        return Path(os.path.realpath(Path(path).expanduser()))
    except (ValueError, RuntimeError) as error:  # a null byte; no home folder
        raise FileRefusedError(f"{_named(path)} is not a path: {error}") from error


def _named(path: str | Path) -> str:
    text = str(path)[:200]
    return text if text.isprintable() else repr(text)
