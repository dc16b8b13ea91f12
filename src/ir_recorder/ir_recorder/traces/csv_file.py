"""Traces as CSV: a line of headings, then numbers; commas, semicolons or tabs between them.

Read in blocks, so that memory holds the wanted columns only. An empty cell is a missing value. Where
semicolons or tabs separate, commas may be decimal. Time may be written as date and time of ISO 8601. The text
is UTF-8, or UTF-16 with its byte order mark ("Unicode text" of a spreadsheet).
"""

from __future__ import annotations

import csv
import os
import stat
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from itertools import islice
from pathlib import Path
from sys import intern
from types import MappingProxyType
from typing import TextIO

import numpy as np

from ir_msgs_py.arrays import FloatArray, IntArray
from ir_recorder.errors import TraceError
from ir_recorder.traces.mapping import TraceMapping
from ir_recorder.traces.trace import LOAD, MODE, TIME, Trace
from ir_recorder.traces.units import parsed

BYTES_MAX = 500_000_000
VALUES_MAX = 50_000_000  # 400 MB of memory
_BLOCK = 10_000  # lines that are converted at a time
_WORDS = (MODE, LOAD)  # columns of words

Wanted = Callable[[str], bool]
"""Whether a column of this name is read where no mapping names the columns."""


def read_csv(path: Path, wanted: Wanted, mapping: TraceMapping) -> Trace:
    """The trace of a CSV file; TraceError with the line and the column that is wrong."""
    with _opened(path) as file:
        try:
            return _Reader(path, file, wanted, mapping).trace()
        except csv.Error as error:
            raise TraceError(f"{path}: {error}") from error


def _opened(path: Path) -> TextIO:
    """A regular file of bounded size as lines; never waits on a FIFO or device."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise TraceError(f"{path}: can't be opened: {reason}") from error
    status = os.fstat(descriptor)
    fault = "is not a regular file" if not stat.S_ISREG(status.st_mode) else ""
    if not fault and status.st_size > BYTES_MAX:
        fault = f"has {status.st_size} bytes, at most {BYTES_MAX} are read"
    if fault:
        os.close(descriptor)
        raise TraceError(f"{path}: {fault}")
    utf_16 = os.pread(descriptor, 2, 0) in (BOM_UTF16_LE, BOM_UTF16_BE)
    return os.fdopen(descriptor, encoding="utf-16" if utf_16 else "utf-8-sig", errors="replace", newline="")


class _Reader:
    def __init__(self, path: Path, file: Iterator[str], wanted: Wanted, mapping: TraceMapping) -> None:
        self._path, self._mapping = path, mapping
        self._file, self._begin = file, 0
        header = self._header()
        self._delimiter = max(";\t,", key=header.count)
        self._headings = [each.strip() for each in next(csv.reader([header], delimiter=self._delimiter), [])]
        self._places = self._chosen(wanted)
        if TIME not in self._places:
            known = ", ".join(self._headings)[:200]
            raise TraceError(f"{path}:{self._begin}: there is no column time, there is: {known}")

    def _header(self) -> str:
        for line in self._file:
            self._begin += 1
            if "\0" in line:
                fault = "has zero bytes: it is no text in UTF-8, nor in UTF-16 with its mark"
                raise TraceError(f"{self._path}:{self._begin}: {fault}; save it as CSV UTF-8")
            if line.strip() and not line.startswith("#"):
                return line
        raise TraceError(f"{self._path}: has 0 points, a trace has at least 2")

    def _chosen(self, wanted: Wanted) -> dict[str, tuple[int, float]]:
        """Place and factor of each column by its name."""
        where = f"{self._path}:{self._begin}"
        places: dict[str, tuple[int, float]] = {}
        for name, column in self._mapping.columns.items():
            if column.heading not in self._headings:
                known = ", ".join(self._headings)[:200]
                raise TraceError(f"{where}: there is no column {column.heading[:80]!r}, there is: {known}")
            places[name] = self._headings.index(column.heading), column.factor
        if self._mapping.columns:
            return places
        for k, heading in enumerate(self._headings):
            name, scale = _named(heading, where, wanted)
            if not wanted(name):
                continue
            if name in places:
                raise TraceError(f"{where}: column {name} is there twice")
            places[name] = k, scale
        return places

    def trace(self) -> Trace:
        """All rows."""
        numbers = [name for name in self._places if name not in _WORDS]
        texts: dict[str, list[str]] = {name: [] for name in self._places if name in _WORDS}
        blocks, lines, size, line = [], [], 0, self._begin
        rows = csv.reader(self._file, delimiter=self._delimiter)
        while block := list(islice(rows, _BLOCK)):
            own = [(line + k, row) for k, row in enumerate(block, 1) if row]
            blocks.append(self._block(own, numbers))
            lines.append(np.array([number for number, _ in own], np.int64))
            for name, words in texts.items():
                words.extend(intern(row[self._places[name][0]].strip()) for _, row in own)
            line, size = line + len(block), size + blocks[-1].size
            if size > VALUES_MAX:
                raise TraceError(f"{self._path}:{line}: more than {VALUES_MAX} values, the limit")
        values = np.concatenate(blocks) if blocks else np.empty((0, len(numbers)))
        columns = {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(numbers)}
        time = columns.pop(TIME)
        self._check_time(time, lines)
        spoken = MappingProxyType({name: tuple(each) for name, each in texts.items()})
        return Trace(str(self._path), time, MappingProxyType(columns), spoken, sampled=self._mapping.sampled)

    def _block(self, rows: Sequence[tuple[int, Sequence[str]]], names: Sequence[str]) -> FloatArray:
        """Values of these columns (rows, names) in SI."""
        values = np.empty((len(rows), len(names)))
        for k, (line, row) in enumerate(rows):
            if len(row) != len(self._headings):
                raise TraceError(
                    f"{self._path}:{line}: has {len(row)} values, "
                    f"the header names {len(self._headings)} columns"
                )
            for j, name in enumerate(names):
                place, scale = self._places[name]
                values[k, j] = scale * self._number(row[place], name, line)
        return values

    def _number(self, text: str, name: str, line: int) -> float:
        try:
            value = float(text)
        except ValueError:
            value = self._unusual(text.strip(), name, line)
        else:
            if value - value != 0.0:  # inf or nan, written out
                raise TraceError(f"{self._path}:{line}: {name} is {text[:40]!a}, it must be finite")
        return value

    def _unusual(self, text: str, name: str, line: int) -> float:
        if not text and name != TIME:
            return float("nan")
        try:
            if self._delimiter != "," and text.count(",") == 1:
                return float(text.replace(",", "."))
            if name == TIME:
                return datetime.fromisoformat(text).timestamp()
        except ValueError:
            pass
        raise TraceError(f"{self._path}:{line}: {name} is {text[:40]!a}, it must be a number")

    def _check_time(self, time: FloatArray, lines: Sequence[IntArray]) -> None:
        back = np.flatnonzero(np.diff(time) <= 0.0)
        if len(back):
            k = int(back[0]) + 1
            line = np.concatenate(lines)[k]
            raise TraceError(
                f"{self._path}:{line}: time is {time[k]:.12g} s, it must increase: the row before has "
                f"{time[k - 1]:.12g} s"
            )


def _named(heading: str, where: str, wanted: Wanted) -> tuple[str, float]:
    """Name and factor of a heading; a unit in brackets has to be known only where the name is wanted."""
    bare = heading.split("[")[0].split("(")[0].strip()
    if wanted(heading) or (bare != heading and not wanted(bare)):
        return heading, 1.0
    return parsed(heading, where)
