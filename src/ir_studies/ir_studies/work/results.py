"""The results of a study in a file that only grows: whatever ends the program, what was found is
there.

One line of JSON per job. A line that was not finished is taken off when the file is opened again.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from types import TracebackType
from typing import Any

from ir_description import Cell
from ir_description.cell import Task
from ir_studies.errors import StudyError
from ir_studies.work.fingerprint import computed_with
from ir_studies.work.job import Job, Row

# Files that every worker reads, known by their digests.

PLANT = "plant "
TASK = "task "
TASKS = "tasks of "
"""Before the name of what is no cell."""
_CHARACTERS = 16  # of a digest


def task_digests(name: str, cell: Cell) -> dict[str, str]:
    """A digest for every task of a cell; cell_hash leaves them out."""
    return {f"{TASK}{task.name} of {name}": _digest([task]) for task in cell.tasks}


def digest_of_tasks(name: str, cell: Cell) -> dict[str, str]:
    """One digest for all tasks of a cell, for what depends on their number."""
    return {f"{TASKS}{name}": _digest(cell.tasks)}


def title(name: str) -> str:
    """What a name stands for."""
    return name if name.startswith((PLANT, TASK, TASKS)) else f"cell {name}"


def refuse_others(given: Mapping[str, str], found: Mapping[str, str]) -> None:
    """StudyError where this process reads something else than the study: an older file, or an
    edited one.
    """
    for name, digest in given.items():
        if found.get(name) != digest:
            raise StudyError(f"{title(name)} is not here what the study has read")


def _digest(tasks: Sequence[Task]) -> str:
    ends = [(task.name, task.start.tolist(), task.goal.tolist()) for task in tasks]
    return sha256(repr(ends).encode()).hexdigest()[:_CHARACTERS]


NAME = "results.jsonl"
_TITLES = {"arena": "an arena", "layout": "a layout study", "statistics": "statistics"}


class Results:
    """The file of a folder, for one program at a time; rows by the keys of their jobs.

    kind: of the study. budget: settings that all rows depend on. cells: content hash by name, of
    plants and tasks too; others may be added later, none may change.
    """

    def __init__(
        self, folder: Path, kind: str, budget: Mapping[str, Any], cells: Mapping[str, str]
    ) -> None:
        """Open or begin. StudyError where the folder is in use or holds results of other
        settings.
        """
        self.rows: dict[str, Row] = {}
        self._made: list[str] = []  # with what the rows of the file were computed
        self.path = folder / NAME
        self._kind = kind
        self._budget = json.loads(json.dumps(dict(budget)))
        try:
            folder.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
            self._file = os.fdopen(os.open(self.path, flags, 0o644), "r+b")
        except OSError as error:
            raise StudyError(f"{self.path} can't be written: {error.strerror}") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._read(cells)
        except BlockingIOError as error:
            self._drop()
            raise StudyError(
                f"{folder} is in use by another study: wait, or name another folder"
            ) from error
        except OSError as error:  # a file system without locks, a disk that can't be read
            self._drop()
            raise StudyError(f"{self.path} can't be used: {error.strerror}") from error
        except StudyError:
            self._drop()
            raise

    def _read(self, cells: Mapping[str, str]) -> None:
        """Take the rows of an earlier run; a line that lacks its end is cut off."""
        content = self._file.read()
        whole = content[: content.rfind(b"\n") + 1]
        head = {"format": f"ir_{self._kind}_results/1", "budget": self._budget, "cells": {}}
        lines = whole.split(b"\n")[:-1]
        found = _mapping(lines[0]) if lines else head
        begun = lines or json.dumps(head).encode().startswith(content)
        if not (begun and found is not None and found.get("format") == head["format"]):
            raise StudyError(
                f"{self.path} holds no results of {_TITLES[self._kind]}: name another folder"
            )
        rows = [self._row_of_line(number, line) for number, line in enumerate(lines[1:], start=2)]
        self.rows = {row["key"]: row for row in rows if "key" in row}
        known = dict(pair for row in rows for pair in row.get("cells", {}).items())
        self._made = [str(row["made_with"]) for row in rows if "made_with" in row]
        self._check(found, known, cells)
        self._file.truncate(len(whole))
        self._file.seek(len(whole))
        if not lines:
            self._write(head)
        new = {name: digest for name, digest in cells.items() if name not in known}
        if new:
            self._write({"cells": new})

    def _row_of_line(self, number: int, line: bytes) -> Row:
        """A line that this class has written."""
        row = _mapping(line)
        if (
            row is None
            or not isinstance(row.get("key", ""), str)
            or not isinstance(row.get("cells", {}), dict)
        ):
            said = "delete the line, and its job is made again"
            raise StudyError(f"{self.path}: line {number} is damaged: {said}")
        return row

    def _check(
        self, head: dict[str, Any], known: Mapping[str, str], cells: Mapping[str, str]
    ) -> None:
        begun = head.get("budget", {})
        for key in {**begun, **self._budget}:
            if begun.get(key) != self._budget.get(key):
                raise StudyError(
                    f"{self.path} holds results with {key} {begun.get(key)!s:.80}, the settings "
                    f"have {self._budget.get(key)!s:.80}: name another folder"
                )
        for name, digest in cells.items():
            if known.get(name, digest) != digest:
                raise StudyError(
                    f"{self.path} holds results of another {title(name)}: name another folder"
                )

    def add(self, job: Job, row: Row) -> None:
        """Keep a row: it is on the disk when this returns."""
        here = computed_with(self._kind)
        if self._made[-1:] != [here]:
            self._made.append(here)
            self._write({"made_with": here})
        kept: Row = {"key": job.key, **row}
        self.rows[job.key] = kept
        self._write(kept)

    @property
    def remark(self) -> str:
        """What to know of rows that were not all computed with the same, "" where they were."""
        made = list(dict.fromkeys(self._made))
        if len(made) < 2:
            return ""
        said = "; ".join(made)
        return f"The results were not all computed with the same and may differ by that: {said}."

    def _write(self, line: object) -> None:
        try:
            self._file.write(json.dumps(line).encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise StudyError(f"{self.path} can't be written: {error.strerror}") from error

    def _drop(self) -> None:
        """Close the file, whatever it says: what was not written is refused by who asks."""
        with suppress(OSError):
            self._file.close()

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._file.close()
        except OSError:  # a full disk: what could not be written was refused before
            if error is None:
                raise


def _mapping(line: bytes) -> dict[str, Any] | None:
    """What a line holds; None where it is no mapping."""
    try:
        read = json.loads(line)
    except (ValueError, RecursionError):  # brackets by the thousand
        return None
    return read if isinstance(read, dict) else None
