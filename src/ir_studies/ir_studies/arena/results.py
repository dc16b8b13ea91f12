"""The results of an arena in a file that only grows: whatever ends the program, what was found is there.

One line of JSON per run. A line that was not finished is taken off when the file is opened again.
"""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any

from ir_description import cell_hash, load_cell
from ir_studies.arena.entries import Entry
from ir_studies.arena.one_run import Row
from ir_studies.arena.settings import ArenaSettings
from ir_studies.errors import FolderError

FORMAT = "ir_arena_results/1"
NAME = "results.jsonl"


class Results:
    """The file of a folder, for one program at a time; rows by the keys of their entries."""

    def __init__(self, folder: Path, settings: ArenaSettings) -> None:
        """Open or begin. FolderError where the folder is in use or holds results of other settings."""
        self.rows: dict[str, Row] = {}
        self.path = folder / NAME
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = os.fdopen(os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644), "r+b")
        except OSError as error:
            raise FolderError(f"{self.path} can't be written: {error.strerror}") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._read(settings)
        except BlockingIOError as error:
            self._file.close()
            raise FolderError(f"{folder} is in use by another arena: wait, or name another folder") from error
        except FolderError:
            self._file.close()
            raise

    def _read(self, settings: ArenaSettings) -> None:
        content = self._file.read()
        whole = content[: content.rfind(b"\n") + 1]
        head = {"format": FORMAT, "budget": settings.budget, "cells": {}}
        lines = whole.splitlines()
        try:
            found = json.loads(lines[0]) if lines else head
            begun = lines or json.dumps(head).encode().startswith(content)
            if not (begun and isinstance(found, dict) and found.get("format") == FORMAT):
                raise ValueError
            self.rows = {row["key"]: row for row in map(json.loads, lines[1:]) if "key" in row}
            cells = [cell for row in map(json.loads, lines[1:]) for cell in row.get("cells", {}).items()]
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise FolderError(f"{self.path} holds no results of an arena: name another folder") from error
        self._check(found, dict(cells), settings)
        self._file.truncate(len(whole))
        self._file.seek(len(whole))
        if not lines:
            self._write(head)
        new = {name: cell_hash(load_cell(name)) for name in settings.cells if name not in dict(cells)}
        if new:
            self._write({"cells": new})

    def _check(self, head: dict[str, Any], cells: dict[str, str], settings: ArenaSettings) -> None:
        budget = json.loads(json.dumps(settings.budget))
        for key, value in head.get("budget", {}).items():
            if value != budget.get(key):
                raise FolderError(
                    f"{self.path} holds results with {key} {value}, the settings have {budget.get(key)}: "
                    "name another folder"
                )
        for name in settings.cells:
            if name in cells and cells[name] != cell_hash(load_cell(name)):
                raise FolderError(f"{self.path} holds results of another cell {name}: name another folder")

    def add(self, entry: Entry, row: Row) -> None:
        """Keep a row: it is on the disk when this returns."""
        kept: Row = {"key": entry.key, **row}
        self.rows[entry.key] = kept
        self._write(kept)

    def _write(self, line: object) -> None:
        self._file.write(json.dumps(line).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
