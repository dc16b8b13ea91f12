"""Files that other files name: beside them or below, regular, of bounded size, UTF-8."""

from __future__ import annotations

import codecs
import os
import stat
from pathlib import Path

from ir_description.errors import DescriptionFileError, shown
from ir_msgs_py.errors import InvalidValueError

_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_HEAD = 64  # bytes, in which every second one is zero where Latin letters stand in UTF-16


def read_regular_file(path: Path, limit: int) -> bytes:
    """Return the content of a regular file of at most `limit` bytes; never blocks on a FIFO or
    device.
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
    leads out.
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
