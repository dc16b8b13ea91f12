"""The results of a study in a file that only grows: whatever ends the program, what was found is there.

One line of JSON per job. A line that was not finished is taken off when the file is opened again.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from ir_studies.errors import FolderError
from ir_studies.work.job import Job, Row

NAME = "results.jsonl"
PLANT = "plant "
"""Before the name of a plant, whose content counts like that of a cell."""
_TITLES = {"arena": "an arena", "layout": "a layout study", "statistics": "statistics"}


class Results:
    """The file of a folder, for one program at a time; rows by the keys of their jobs.

    kind: of the study. budget: settings that all rows depend on. cells: content hash by name, of plants too;
    others may be added later, none may change.
    """

    def __init__(self, folder: Path, kind: str, budget: Mapping[str, Any], cells: Mapping[str, str]) -> None:
        """Open or begin. FolderError where the folder is in use or holds results of other settings."""
        self.rows: dict[str, Row] = {}
        self.path = folder / NAME
        self._kind, self._budget = kind, json.loads(json.dumps(dict(budget)))
        try:
            folder.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
            self._file = os.fdopen(os.open(self.path, flags, 0o644), "r+b")
        except OSError as error:
            raise FolderError(f"{self.path} can't be written: {error.strerror}") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._read(cells)
        except BlockingIOError as error:
            self._file.close()
            raise FolderError(f"{folder} is in use by another study: wait, or name another folder") from error
        except FolderError:
            self._file.close()
            raise

    def _read(self, cells: Mapping[str, str]) -> None:
        content = self._file.read()
        whole = content[: content.rfind(b"\n") + 1]
        head = {"format": f"ir_{self._kind}_results/1", "budget": self._budget, "cells": {}}
        lines = whole.splitlines()
        try:
            found = json.loads(lines[0]) if lines else head
            begun = lines or json.dumps(head).encode().startswith(content)
            if not (begun and isinstance(found, dict) and found.get("format") == head["format"]):
                raise ValueError
            rows = [json.loads(line) for line in lines[1:]]
            self.rows = {row["key"]: row for row in rows if "key" in row}
            known = dict(pair for row in rows for pair in row.get("cells", {}).items())
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            title = _TITLES[self._kind]
            raise FolderError(f"{self.path} holds no results of {title}: name another folder") from error
        self._check(found, known, cells)
        self._file.truncate(len(whole))
        self._file.seek(len(whole))
        if not lines:
            self._write(head)
        new = {name: digest for name, digest in cells.items() if name not in known}
        if new:
            self._write({"cells": new})

    def _check(self, head: dict[str, Any], known: Mapping[str, str], cells: Mapping[str, str]) -> None:
        begun = head.get("budget", {})
        for key in {**begun, **self._budget}:
            if begun.get(key) != self._budget.get(key):
                raise FolderError(
                    f"{self.path} holds results with {key} {begun.get(key)!s:.80}, the settings have "
                    f"{self._budget.get(key)!s:.80}: name another folder"
                )
        for name, digest in cells.items():
            if known.get(name, digest) != digest:
                raise FolderError(f"{self.path} holds results of another {_title(name)}: name another folder")

    def add(self, job: Job, row: Row) -> None:
        """Keep a row: it is on the disk when this returns."""
        kept: Row = {"key": job.key, **row}
        self.rows[job.key] = kept
        self._write(kept)

    def _write(self, line: object) -> None:
        try:
            self._file.write(json.dumps(line).encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise FolderError(f"{self.path} can't be written: {error.strerror}") from error

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._file.close()
        except OSError:  # a full disk: what could not be written was refused before
            if error is None:
                raise


def _title(name: str) -> str:
    return name if name.startswith(PLANT) else f"cell {name}"
