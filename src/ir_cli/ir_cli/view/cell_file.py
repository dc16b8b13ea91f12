"""The viewed cell's file: read again when it was saved, and copied with what was moved."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from ir_cli.errors import CommandError, InputError, unknown_name
from ir_cli.view.moves import Moves, cell_with, edited
from ir_description import (
    Cell,
    DescriptionError,
    UnknownNameError,
    bundled_cells,
    cell_to_yaml,
    is_path,
    load_cell,
)
from ir_description.library import cell_file_errors
from ir_values.output_files import write_file

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

    @property
    def source(self) -> str:
        """What is looked at, as the page says it."""
        return str(self.path) if self.path is not None else f"bundled cell {self.name}"

    @property
    def stem(self) -> str:
        """What a new file's name begins with."""
        return self.path.stem if self.path is not None else self.name

    @property
    def text(self) -> str:
        """The file's text."""
        if self.path is not None:
            return self.path.read_text(encoding="utf-8")
        return (files("ir_description") / "data" / "cells" / f"{self.name}.yaml").read_text(
            encoding="utf-8"
        )

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
        for path in (str(self.path), *_files_for_cells(self.folder)):
            try:
                status = os.stat(path)
            except OSError:
                continue  # gone since
            found.append((path, status.st_mtime_ns, status.st_size, status.st_ino))
        return tuple(found)


def _files_for_cells(folder: Path) -> Iterator[str]:
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


class Recorded:
    """The cell of a recording, which never changes, and its motion. Raises InputError where it has
    no cell.
    """

    def __init__(self, name: str) -> None:
        from ir_recorder.analysis import analyse
        from ir_recorder.reading import read_recording

        if not Path(name).is_file():
            raise InputError(f"{name[:200]!a} is not a file")
        self.name = name
        self.analysis = analyse(read_recording(name))
        self.folder = Path(name).parent
        self.stem = Path(name).stem
        self.source = f"recording {Path(name).name}"
        self.text = self.analysis.recording.cell_yaml
        if self.analysis.cell is None:
            words = "; ".join(self.analysis.problems) or "it holds no cell"
            raise InputError(f"{name[:200]}: nothing can be drawn: {words}")
        self._cell = self.analysis.cell

    def read(self) -> Reading:
        """The cell as it was recorded."""
        return Reading(self._cell)

    def changed(self, now: float) -> bool:
        """It never does."""
        return False


MOST_COPIES = 1_000


def save(watched: Watched | Recorded, cell: Cell, moves: Moves) -> Path:
    """The new file: the text of the old one, comments and all, with the moves. Raises CommandError.

    cell: as the file has it. No file is ever overwritten, and what was written is read back and
    compared.
    """
    try:
        text = edited(watched.text, cell, moves)
        path = _write_cell(watched, text)
        if cell_to_yaml(load_cell(path)) != cell_to_yaml(cell_with(cell, moves)):
            path.unlink()
            raise CommandError(
                "the file has changed meanwhile, or its poses can't be replaced one by one"
            )
    except (OSError, UnicodeError, ValueError, DescriptionError) as error:
        raise CommandError(str(error)) from error
    return path


def _write_cell(watched: Watched | Recorded, text: str) -> Path:
    for number in range(1, MOST_COPIES):
        path = watched.folder / f"{watched.stem}_moved{'' if number == 1 else f'_{number}'}.yaml"
        try:
            write_file(path, text, new=True)
        except FileExistsError:
            continue
        return path.resolve()
    raise CommandError(f"there are {MOST_COPIES - 1} files {watched.stem}_moved already")
