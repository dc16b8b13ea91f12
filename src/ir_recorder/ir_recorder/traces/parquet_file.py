"""Traces as Parquet, by the optional pyarrow: the same columns as in CSV."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_recorder.errors import TraceError
from ir_recorder.traces.csv_file import VALUES_MAX, WORDS
from ir_recorder.traces.headings import Wanted, chosen
from ir_recorder.traces.mapping import TraceMapping
from ir_recorder.traces.regular_file import opened
from ir_recorder.traces.trace import TIME, Trace


def read_parquet(path: Path, wanted: Wanted, mapping: TraceMapping) -> Trace:
    """The trace of a Parquet file; TraceError where pyarrow isn't installed or a column makes no
    sense.
    """
    try:
        from pyarrow import ArrowException, parquet
    except ImportError as error:
        raise TraceError(f"{path}: Parquet needs pyarrow: pip install pyarrow") from error
    try:
        with os.fdopen(opened(path), "rb") as stream:
            file = parquet.ParquetFile(stream)
            places = chosen(
                [str(name) for name in file.schema_arrow.names], str(path), wanted, mapping
            )
            if file.metadata.num_rows * len(places) > VALUES_MAX:
                raise TraceError(f"{path}: more than {VALUES_MAX} values, the limit")
            table = _read(file, [place for place, _ in places.values()])
    except (ArrowException, OSError) as error:
        raise TraceError(f"{path}: {error}") from error
    columns = dict[str, FloatArray]()
    texts = dict[str, tuple[str, ...]]()
    for (name, (_, scale)), column in zip(places.items(), table, strict=True):
        if name in WORDS:
            texts[name] = tuple(
                "" if each is None else str(each).strip() for each in column.to_pylist()
            )
        else:
            columns[name] = scale * _numbers(path, column, name)
    time = columns.pop(TIME)
    return Trace(
        str(path), time, MappingProxyType(columns), MappingProxyType(texts), sampled=mapping.sampled
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
    """Values (N,), NaN where a cell is empty; times may be dates. TraceError for what is no
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
            raise TraceError(f"{path}: column {name}: {error}") from error
    else:
        raise TraceError(f"{path}: column {name} is of {column.type}, it must be of numbers")
    wrong = np.flatnonzero(~np.isfinite(numbers) if name == TIME else np.isinf(numbers))
    if len(wrong):
        row = int(wrong[0])
        raise TraceError(f"{path}: row {row + 1}: {name} is {numbers[row]:g}, it must be finite")
    return numbers
