"""A cell's file, read again whenever it or a file beside it (a mesh, a robot) has been saved."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ir_description import (
    Cell,
    DescriptionError,
    UnknownNameError,
    bundled_cells,
    cell_file_errors,
    is_path,
    load_cell,
)

from ..errors import InputError
from ..suggestions import unknown_name

SUFFIXES = (".yaml", ".yml", ".stl", ".obj", ".glb", ".gltf", ".bin")
MOST_FILES = 2_000
DEPTH = 2
"""Folders below the cell file's that are looked at."""
STILL = 0.15
"""Seconds without a change after which a file counts as written."""
MOST_ERRORS = 12
Stamp = tuple[tuple[str, int, int, int], ...]


@dataclass(frozen=True, eq=False)
class Reading:
    """The cell of a file, or None and what is wrong with it."""

    cell: Cell | None
    errors: tuple[str, ...] = ()


class Watched:
    """A cell file, or a bundled cell, which never changes. Raises InputError where there is
    none.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.path = None if name in bundled_cells() else Path(name)
        if self.path is None:
            pass
        elif not is_path(name):
            raise InputError(unknown_name("cell", name[:80], bundled_cells(), "ir cell list"))
        elif not self.path.is_file():
            raise InputError(f"{name[:200]!a} is not a file")
        self._stamp = self._stamped()
        self._seen: tuple[Stamp, float] | None = None

    @property
    def folder(self) -> Path:
        """Where files that the cell names stand, and where a new file is written."""
        return self.path.parent if self.path is not None else Path()

    def read(self) -> Reading:
        """The cell as its file has it now."""
        self._stamp = self._stamped()
        try:
            return Reading(load_cell(self.path if self.path is not None else self.name))
        except UnknownNameError as error:
            return Reading(None, (str(error),))
        except DescriptionError as error:
            found = (cell_file_errors(self.path) if self.path is not None else ()) or (error,)
            return Reading(None, tuple(map(str, found[:MOST_ERRORS])))

    def changed(self, now: float) -> bool:
        """Whether it was saved since it was read, and is not being written any more; now: a clock
        [s].
        """
        stamp = self._stamped()
        if stamp == self._stamp:
            self._seen = None
            return False
        if self._seen is None or self._seen[0] != stamp:
            self._seen = stamp, now
        return now - self._seen[1] >= STILL

    def _stamped(self) -> Stamp:
        if self.path is None:
            return ()
        found = []
        for path in (str(self.path), *_beside(self.folder)):
            try:
                status = os.stat(path)
            except OSError:
                continue  # gone since
            found.append((path, status.st_mtime_ns, status.st_size, status.st_ino))
        return tuple(found)


def _beside(folder: Path) -> Iterator[str]:
    """Files that a cell in this folder may name, in a fixed order."""
    count = 0
    for root, folders, names in os.walk(folder or "."):
        depth = len(Path(root).relative_to(folder).parts)
        folders[:] = (
            sorted(each for each in folders if not each.startswith(".")) if depth < DEPTH else []
        )
        for name in sorted(names):
            count += 1
            if count > MOST_FILES:
                return
            if name.lower().endswith(SUFFIXES):
                yield os.path.join(root, name)
