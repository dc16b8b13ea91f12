"""Which files a node or a command may touch: regular files below configured folders, no links out
of them.

A path may come from a request, so it is resolved first, held against the folders, and opened
without following a link and without waiting for a FIFO. Refusals name the path, never what the file
holds.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ir_msgs_py.errors import FileRefusedError

ENVIRONMENT = "IR_FILE_ROOTS"
"""Folders, separated as in PATH, for nodes and commands that are given none."""
_SAFE = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
_MODE = 0o666  # less what the umask takes


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
            f"{_shown(path)} lies outside of the folders that may be used: {known} "
            f"(more by {ENVIRONMENT}, a node's parameter roots, or --root where a command has it)"
        )

    def open_to_read(self, path: str | Path) -> BinaryIO:
        """A regular file; FileRefusedError for another kind or place, OSError where it can't be
        opened.
        """
        return os.fdopen(_opened(self.inside(path), os.O_RDONLY, path), "rb")

    def open_to_write(self, path: str | Path, replaces: bytes | None = None) -> BinaryIO:
        """A new file, or one in place of a file that is empty or starts with the bytes `replaces`.

        Raises FileExistsError where a file is there and `replaces` is None, FileRefusedError for a
        file of
        another kind or place: nothing of it is touched then.
        """
        real = self.inside(path)
        try:
            return os.fdopen(
                os.open(real, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _SAFE, _MODE), "wb"
            )
        except FileExistsError:
            if replaces is None:
                raise
        stream = os.fdopen(_opened(real, os.O_RDWR, path), "r+b")
        try:
            start = stream.read(len(replaces))
            if start not in (b"", replaces):
                raise FileRefusedError(
                    f"{_shown(path)} is a file of another kind: it is not replaced"
                )
            stream.seek(0)
            stream.truncate()
        except BaseException:
            stream.close()
            raise
        return stream


ANYWHERE = FileRoots((Path("/"),))
"""For a script that chooses its files itself."""


def _opened(real: Path, flags: int, path: str | Path) -> int:
    descriptor = os.open(real, flags | _SAFE)
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return descriptor
    os.close(descriptor)
    raise FileRefusedError(f"{_shown(path)} is not a regular file")


def _resolved(path: str | Path) -> Path:
    try:
        return Path(os.path.realpath(Path(path).expanduser()))
    except (ValueError, RuntimeError) as error:  # a null byte; no home folder
        raise FileRefusedError(f"{_shown(path)} is not a path: {error}") from error


def _shown(path: str | Path) -> str:
    text = str(path)[:200]
    return text if text.isprintable() else repr(text)
