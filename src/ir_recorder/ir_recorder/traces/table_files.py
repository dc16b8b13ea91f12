"""Traces as tables in CSV or Parquet files."""

from __future__ import annotations

import csv
import math
import os
import re
import stat
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import chain, compress, islice, pairwise
from pathlib import Path
from sys import intern
from types import MappingProxyType
from typing import Any, TextIO

import numpy as np

from ir_recorder.errors import RecorderError
from ir_recorder.traces.columns import (
    Column,
    TraceMapping,
    Wanted,
    chosen,
    multiplied,
    named,
    other_writing,
    split_unit,
)
from ir_recorder.traces.makers import MakersColumns, makers_columns
from ir_recorder.traces.trace import ENERGY, LOAD, MODE, POWER, TIME, Trace
from ir_values.arrays import BoolArray, FloatArray, IntArray, number_of
from ir_values.errors import listed

# Files of measurements as a user names them: regular ones of a bounded size.

BYTES_MAX = 500_000_000


def opened(path: Path) -> int:
    """A descriptor of a file of at most BYTES_MAX; never waits on a FIFO or a device. Raises
    RecorderError.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise RecorderError(f"{path}: can't be opened: {reason}") from error
    status = os.fstat(descriptor)
    fault = "is not a regular file" if not stat.S_ISREG(status.st_mode) else ""
    if not fault and status.st_size > BYTES_MAX:
        fault = f"has {status.st_size} bytes, at most {BYTES_MAX} are read"
    if fault:
        os.close(descriptor)
        raise RecorderError(f"{path}: {fault}")
    return descriptor


# Traces as CSV: a line of headings, then numbers; commas, semicolons, tabs or spaces between
# them.
#
# Read in blocks, so that memory holds the wanted columns only. An empty cell and NaN are missing
# values. Where no commas separate, they may be decimal. Time may be written as date and time of
# ISO 8601. A row that says the same as the one before, and a last line that was cut, are left
# out; the trace's problems say so. The text is UTF-8, or UTF-16 with its byte order mark
# ("Unicode text" of a spreadsheet).

VALUES_MAX = 50_000_000  # 400 MB of memory
_BLOCK = 10_000  # lines that are converted at a time
WORDS = (MODE, LOAD)  # columns of words


def read_csv(
    path: Path, wanted: Wanted, mapping: TraceMapping, joint_names: Sequence[str] = ()
) -> Trace:
    """The trace of a CSV file; RecorderError with the line and the column that is wrong.

    joint_names: of the robot, for headings as its maker's logs have them.
    """
    with _lines(path) as file:
        try:
            return _TableReader(path, file, wanted, mapping, _is_cut_off(file), joint_names).trace()
        except csv.Error as error:
            raise RecorderError(f"{path}: {error}") from error


def _lines(path: Path) -> TextIO:
    """The lines of a file in UTF-8 or, where it begins so, UTF-16."""
    descriptor = opened(path)
    utf_16 = os.pread(descriptor, 2, 0) in (BOM_UTF16_LE, BOM_UTF16_BE)
    return os.fdopen(
        descriptor, encoding="utf-16" if utf_16 else "utf-8-sig", errors="replace", newline=""
    )


def _is_cut_off(file: TextIO) -> bool:
    """Whether the last line lacks its end: what writes the file may have been stopped in it."""
    size = os.fstat(file.fileno()).st_size
    end = os.pread(file.fileno(), 2, max(size - 2, 0)).strip(b"\0")  # UTF-16 has two bytes for each
    return not end.endswith((b"\r", b"\n"))


class _TableReader:
    """cut: the last line has no end; one that lacks values is left out then."""

    def __init__(
        self,
        path: Path,
        file: Iterator[str],
        wanted: Wanted,
        mapping: TraceMapping,
        cut: bool,
        joint_names: Sequence[str],
    ) -> None:
        self._path = path
        self._cut = cut
        self._file = file
        self._begin = 0
        self._problems: list[str] = []
        header = self._header()
        self._delimiter = max(
            ";\t, ", key=lambda sign: (header.count(sign) > 0, sign != " ", header.count(sign))
        )
        self._expected = ""
        self._lengths: list[int] = []  # of the vectors in each column; 0: it has none
        self._headings = [each.strip() for each in next(self._split([header]), [])]
        self._spread_vectors()
        where = f"{path}:{self._begin}"
        self._expected = self._expected or f"the header names {len(self._headings)} columns"
        if _is_row(self._headings):
            self._expected = f"line {self._begin}, the first, has {len(self._headings)}"
            self._file = chain([header], self._file)
            self._begin -= 1
            self._headings = _numbers_of(self._headings, where, mapping)
        self._maker = _maker_of(self._headings, where, wanted, mapping, joint_names)
        self._mapping = mapping if self._maker is None else self._maker.mapping
        self._places = chosen(self._headings, where, wanted, self._mapping)

    def _split(self, lines: Iterable[str]) -> Iterator[list[str]]:
        """Rows of cells; several spaces separate as one does, vectors in one cell have one each."""
        rows = csv.reader(lines, delimiter=self._delimiter, skipinitialspace=self._delimiter == " ")
        return map(self._spread, rows) if any(self._lengths) else rows

    def _spread_vectors(self) -> None:
        """Headings of their own for the entries of vectors that stand in one cell, as
        "[1.0, 2.0]"; the first row says how many they are.
        """
        first = list(islice(self._file, 1))
        self._file = chain(first, self._file)
        cells = next(self._split(first), [])
        if len(cells) != len(self._headings):
            return
        lengths = [len(_entries(cell)) for cell in cells]
        if not any(lengths):
            return
        self._lengths = lengths
        headings = []
        for heading, length in zip(self._headings, lengths, strict=True):
            name, unit = split_unit(heading)
            ending = f" [{unit}]" if unit else ""
            headings += [f"{name}_{k}{ending}" for k in range(length)] or [heading]
        self._headings = headings
        self._expected = f"the header and the first row name {len(headings)} columns"

    def _spread(self, row: list[str]) -> list[str]:
        """A row with one cell for each entry of its vectors."""
        if len(row) != len(self._lengths):
            return row
        cells: list[str] = []
        for cell, length in zip(row, self._lengths, strict=True):
            if length:
                cells += _entries(cell) or [""] * length
            else:
                cells.append(cell)
        return cells

    def _header(self) -> str:
        for line in self._file:
            self._begin += 1
            if "\0" in line:
                fault = "has zero bytes: it is no text in UTF-8, nor in UTF-16 with its mark"
                raise RecorderError(f"{self._path}:{self._begin}: {fault}; save it as CSV UTF-8")
            if line.strip() and not line.startswith("#"):
                return line
        raise RecorderError(f"{self._path}: has 0 points, a trace has at least 2")

    def trace(self) -> Trace:
        """All rows."""
        numbers = [name for name in self._places if name not in WORDS]
        values, texts, lines = self._all_rows(numbers)
        columns = {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(numbers)}
        if TIME not in columns:
            columns[TIME] = self._mapping.step * np.arange(len(values), dtype=np.float64)
        rises = (np.diff(columns[TIME]) > 0.0).all()
        if not rises:
            kept = _once(values, texts)
            repeated = np.count_nonzero(~kept)
            if repeated:
                self._problems.append(f"{repeated} rows repeat the one before: left out")
                columns = {name: column[kept] for name, column in columns.items()}
                texts = {name: tuple(compress(words, kept)) for name, words in texts.items()}
                lines = [np.concatenate(lines)[kept]]
        time = columns.pop(TIME)
        self._check_time(time, lines)
        columns = multiplied(columns, self._mapping)
        if self._maker is not None:
            columns, note = self._maker.proved(columns, f"{self._path}:{self._begin}")
            self._problems.append(note)
        return Trace(
            str(self._path),
            time,
            MappingProxyType(columns),
            MappingProxyType(texts),
            (*self._problems, *_not_read(self._headings, self._places), *_missing(columns)),
            self._mapping.sampled,
        )

    def _all_rows(
        self, numbers: Sequence[str]
    ) -> tuple[FloatArray, dict[str, tuple[str, ...]], list[IntArray]]:
        """Values (N, columns) of the columns `numbers`, the words of the others, and the lines of
        the file that rows stand in, in blocks.

        A block of plain numbers is read at once, any other row by row, which is slower.
        """
        words: dict[str, list[str]] = {name: [] for name in self._places if name in WORDS}
        blocks = []
        lines = []
        size = 0
        line = self._begin
        following = list(islice(self._file, _BLOCK))
        while following:
            block = following
            following = list(islice(self._file, _BLOCK))
            plain = None if words else self._plain(block, numbers)
            if plain is not None:
                blocks.append(plain)
                lines.append(line + 1 + np.arange(len(block)))
            else:
                own = self._rows(block, line, last=not following)
                blocks.append(self._block(own, numbers))
                lines.append(np.array([number for number, _ in own], np.int64))
                for name, column in words.items():
                    place = self._places[name][0]
                    column.extend(intern(row[place].strip()) for _, row in own)
            line = line + len(block)
            size = size + blocks[-1].size
            if size > VALUES_MAX:
                raise RecorderError(
                    f"{self._path}:{line}: more than {VALUES_MAX} values, the limit"
                )
        values = np.concatenate(blocks) if blocks else np.empty((0, len(numbers)))
        return values, {name: tuple(column) for name, column in words.items()}, lines

    def _rows(self, block: Sequence[str], before: int, last: bool) -> list[tuple[int, list[str]]]:
        """The lines of a block as rows of cells with their numbers; blank ones are none."""
        own = [(before + k, row) for k, row in enumerate(self._split(block), 1) if row]
        if self._cut and last and own and len(own[-1][1]) < len(self._headings):
            self._problems.append(f"line {own.pop()[0]}, the last one, was cut: left out")
        return own

    def _plain(self, block: Sequence[str], names: Sequence[str]) -> FloatArray | None:
        """Values of these columns (rows, names) in SI where the lines hold finite numbers alone, by
        NumPy's parser; None where anything else is in them.
        """
        between = len(self._headings) - 1
        if any(self._lengths) or any(line.count(self._delimiter) != between for line in block):
            return None
        places = [self._places[name][0] for name in names]
        try:
            values = np.loadtxt(
                block, delimiter=self._delimiter, usecols=places, comments=None, ndmin=2
            )
        except ValueError:
            return None
        if values.shape != (len(block), len(names)) or not np.isfinite(values).all():
            return None
        return np.asarray(values * [self._places[name][1] for name in names])

    def _block(self, rows: Sequence[tuple[int, Sequence[str]]], names: Sequence[str]) -> FloatArray:
        """Values of these columns (rows, names) in SI."""
        values = np.empty((len(rows), len(names)))
        for k, (line, row) in enumerate(rows):
            if len(row) != len(self._headings):
                raise RecorderError(f"{self._path}:{line}: has {len(row)} values, {self._expected}")
            for j, name in enumerate(names):
                place, scale = self._places[name]
                values[k, j] = scale * self._number(row[place], name, line)
        return values

    def _number(self, text: str, name: str, line: int) -> float:
        try:
            value = number_of(text)
        except ValueError:
            value = self._unusual(text.strip(), name, line)
        else:
            if value - value != 0.0 and (
                value == value or name == TIME
            ):  # inf; nan is a missing value
                raise RecorderError(
                    f"{self._path}:{line}: {name} is {text[:40]!a}, it must be finite"
                )
        return value

    def _unusual(self, text: str, name: str, line: int) -> float:
        if not text and name != TIME:
            return float("nan")
        try:
            if self._delimiter != "," and text.count(",") == 1:
                return number_of(text.replace(",", "."))
            if name == TIME:
                return datetime.fromisoformat(text).timestamp()
        except ValueError:
            pass
        raise RecorderError(f"{self._path}:{line}: {name} is {text[:40]!a}, it must be a number")

    def _check_time(self, time: FloatArray, lines: Sequence[IntArray]) -> None:
        back = np.flatnonzero(np.diff(time) <= 0.0)
        if len(back):
            k = int(back[0]) + 1
            line = np.concatenate(lines)[k]
            raise RecorderError(
                f"{self._path}:{line}: time is {time[k]:.12g} s, it must increase: the row "
                f"before has {time[k - 1]:.12g} s"
            )


_VECTOR = re.compile(r"\s*[\[(](.*)[\])]\s*", re.DOTALL)
_BETWEEN = re.compile(r"[\s,;]+")


def _entries(cell: str) -> list[str]:
    """Entries of a vector in brackets; none where a cell is no vector."""
    found = _VECTOR.fullmatch(cell)
    return [] if found is None else [each for each in _BETWEEN.split(found[1]) if each]


def _is_row(cells: Sequence[str]) -> bool:
    """Whether a first line is no line of headings: every cell is a number."""
    try:
        return len(cells) > 1 and all(
            math.isfinite(number_of(each.replace(",", "."))) for each in cells
        )
    except ValueError:
        return False


def _numbers_of(cells: Sequence[str], where: str, mapping: TraceMapping) -> list[str]:
    """Headings of a file without any. RecorderError where no mapping gives columns by number."""
    named = [column for column in mapping.columns.values() if not column.number]
    if named or not mapping.columns:
        raise RecorderError(
            f"{where}: has {len(cells)} columns without headings: a mapping (--mapping) names them "
            "by number, as columns: {time: {column: 1, unit: s}, joint_a1: {column: 2, unit: rad}}"
        )
    return [f"number {k}" for k in range(1, len(cells) + 1)]


def _maker_of(
    headings: Sequence[str],
    where: str,
    wanted: Wanted,
    mapping: TraceMapping,
    joint_names: Sequence[str],
) -> MakersColumns | None:
    """What the headings of a maker's log mean, where no mapping and no name of a joint says it;
    what is read by its own name beside the joints is still read.
    """
    if mapping.columns:
        return None
    plain = {heading: named(heading, where, wanted) for heading in headings}
    if any(name in joint_names for name, _ in plain.values()):
        return None
    times = [Column(heading, scale) for heading, (name, scale) in plain.items() if name == TIME]
    time = times[0] if times else None
    found = makers_columns(headings, joint_names, where, time, mapping.step)
    if found is None:
        return None
    beside = {
        name: Column(heading, scale)
        for heading, (name, scale) in plain.items()
        if name != TIME and wanted(name)
    }
    for name in (POWER, ENERGY):
        other = other_writing(headings, where, name) if name not in beside else None
        if other is not None:
            beside[name] = Column(headings[other[0]], other[1])
    columns = MappingProxyType({**found.mapping.columns, **beside})
    return replace(found, mapping=replace(mapping, columns=columns))


def table_trace(
    path: Path,
    table: Mapping[str, FloatArray],
    wanted: Wanted,
    mapping: TraceMapping,
    joint_names: Sequence[str],
) -> Trace:
    """The trace of a table of numbers (N,) by heading; RecorderError where a column makes no
    sense.
    """
    headings = list(table)
    maker = _maker_of(headings, str(path), wanted, mapping, joint_names)
    mapping = mapping if maker is None else maker.mapping
    places = chosen(headings, str(path), wanted, mapping)
    columns = {name: scale * table[headings[place]] for name, (place, scale) in places.items()}
    if TIME not in columns:
        columns[TIME] = mapping.step * np.arange(len(table[headings[0]]), dtype=np.float64)
    time = columns.pop(TIME)
    columns = multiplied(columns, mapping)
    notes: list[str] = []
    if maker is not None:
        columns, note = maker.proved(columns, str(path))
        notes.append(note)
    notes += [*_not_read(headings, places), *_missing(columns)]
    return Trace(
        str(path), time, MappingProxyType(columns), problems=tuple(notes), sampled=mapping.sampled
    )


_NAMED = 8  # in a sentence


def _not_read(headings: Sequence[str], places: Mapping[str, tuple[int, float]]) -> Iterator[str]:
    """A sentence on the columns that are left out."""
    read = {place for place, _ in places.values()}
    others = [heading for k, heading in enumerate(headings) if heading and k not in read]
    if others:
        yield f"columns that are not read: {listed((each[:40] for each in others), _NAMED)}"


def _missing(columns: Mapping[str, FloatArray]) -> Iterator[str]:
    """A sentence on the values of columns, each (N,), that are missing."""
    counts = {name: np.count_nonzero(np.isnan(values)) for name, values in columns.items()}
    gone = [f"{count} of {name}" for name, count in counts.items() if count]
    if gone:
        yield f"values that are missing: {listed(gone, _NAMED)}"


def _once(values: FloatArray, spoken: Mapping[str, Sequence[str]]) -> BoolArray:
    """Which rows (N,) say something else than the one before, in values (N, columns) or words."""
    before = values[:-1]
    after = values[1:]
    kept = np.ones(len(values), bool)
    kept[1:] = ((before != after) & ~(np.isnan(before) & np.isnan(after))).any(axis=1)
    for words in spoken.values():
        kept[1:] |= [first != second for first, second in pairwise(words)]
    return kept


# Traces as Parquet, by the optional pyarrow: the same columns as in CSV.


def read_parquet(
    path: Path, wanted: Wanted, mapping: TraceMapping, joint_names: Sequence[str] = ()
) -> Trace:
    """The trace of a Parquet file; RecorderError where pyarrow isn't installed or a column makes no
    sense.
    """
    try:
        from pyarrow import ArrowException, parquet
    except ImportError as error:
        raise RecorderError(f"{path}: Parquet needs pyarrow: pip install pyarrow") from error
    try:
        with os.fdopen(opened(path), "rb") as stream:
            file = parquet.ParquetFile(stream)
            headings = [str(name) for name in file.schema_arrow.names]
            maker = _maker_of(headings, str(path), wanted, mapping, joint_names)
            mapping = mapping if maker is None else maker.mapping
            places = chosen(headings, str(path), wanted, mapping)
            if file.metadata.num_rows * len(places) > VALUES_MAX:
                raise RecorderError(f"{path}: more than {VALUES_MAX} values, the limit")
            table = _read(file, [place for place, _ in places.values()])
    except (ArrowException, OSError) as error:
        raise RecorderError(f"{path}: {error}") from error
    columns = dict[str, FloatArray]()
    texts = dict[str, tuple[str, ...]]()
    for (name, (_, scale)), column in zip(places.items(), table, strict=True):
        if name in WORDS:
            texts[name] = tuple(
                "" if each is None else str(each).strip() for each in column.to_pylist()
            )
        else:
            columns[name] = scale * _numbers(path, column, name)
    if TIME not in columns:
        columns[TIME] = mapping.step * np.arange(len(table[0]), dtype=np.float64)
    time = columns.pop(TIME)
    columns = multiplied(columns, mapping)
    notes: list[str] = []
    if maker is not None:
        columns, note = maker.proved(columns, str(path))
        notes.append(note)
    notes += [*_not_read(headings, places), *_missing(columns)]
    said = tuple(notes)
    return Trace(
        str(path), time, MappingProxyType(columns), MappingProxyType(texts), said, mapping.sampled
    )


def _read(file: Any, places: list[int]) -> list[Any]:
    """The columns at these places of the schema; only they are read."""
    names = [file.schema_arrow.names[place] for place in places]
    table = file.read(columns=names)
    return [table.column(name) for name in names]


def _numeric(types: Any) -> tuple[Callable[[Any], bool], ...]:
    """What holds numbers; a column without a single value is of type null."""
    return types.is_integer, types.is_floating, types.is_decimal, types.is_null


def _numbers(path: Path, column: Any, name: str) -> FloatArray:
    """Values (N,), NaN where a cell is empty; times may be dates. RecorderError for what is no
    number.
    """
    from pyarrow import ArrowException, types

    if name == TIME and types.is_timestamp(column.type):
        instants = column.to_numpy().astype("datetime64[ns]")
        numbers = np.where(np.isnat(instants), np.nan, instants.astype(np.int64) * 1e-9)
    elif any(each(column.type) for each in _numeric(types)):
        try:
            numbers = np.array(column.cast("float64").to_numpy(), np.float64)
        except ArrowException as error:
            raise RecorderError(f"{path}: column {name}: {error}") from error
    else:
        raise RecorderError(f"{path}: column {name} is of {column.type}, it must be of numbers")
    wrong = np.flatnonzero(~np.isfinite(numbers) if name == TIME else np.isinf(numbers))
    if len(wrong):
        row = int(wrong[0])
        raise RecorderError(f"{path}: row {row + 1}: {name} is {numbers[row]:g}, it must be finite")
    return numbers
