"""Traces as Parquet, by the optional pyarrow: the same columns as in CSV."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_recorder.errors import TraceError
from ir_recorder.traces.csv_file import VALUES_MAX, Wanted
from ir_recorder.traces.mapping import TraceMapping
from ir_recorder.traces.trace import LOAD, MODE, TIME, Trace
from ir_recorder.traces.units import parsed


def read_parquet(path: Path, wanted: Wanted, mapping: TraceMapping) -> Trace:
    """The trace of a Parquet file; TraceError where pyarrow isn't installed or a column makes no sense."""
    try:
        from pyarrow import ArrowException, parquet
    except ImportError as error:
        raise TraceError(f"{path}: Parquet needs pyarrow: pip install pyarrow") from error
    try:
        file = parquet.ParquetFile(path)
        places = _places(path, [str(name) for name in file.schema_arrow.names], wanted, mapping)
        if file.metadata.num_rows * len(places) > VALUES_MAX:
            raise TraceError(f"{path}: more than {VALUES_MAX} values, the limit")
        table = file.read(columns=[heading for heading, _ in places.values()])
        words = {
            name: tuple(str(each) for each in table.column(heading).to_pylist())
            for name, (heading, _) in places.items()
            if name in (MODE, LOAD)
        }
        columns = {
            name: scale * _numbers(path, table.column(heading), name)
            for name, (heading, scale) in places.items()
            if name not in words
        }
    except (ArrowException, OSError) as error:
        raise TraceError(f"{path}: {error}") from error
    time = columns.pop(TIME)
    return Trace(str(path), time, MappingProxyType(columns), MappingProxyType(words), sampled=mapping.sampled)


def _places(
    path: Path, headings: list[str], wanted: Wanted, mapping: TraceMapping
) -> dict[str, tuple[str, float]]:
    """Heading and factor of each column by its name."""
    if mapping.columns:
        places = {name: (column.heading, column.factor) for name, column in mapping.columns.items()}
    else:
        named = {heading: parsed(heading, str(path)) for heading in headings if not wanted(heading)}
        places = {name: (heading, scale) for heading, (name, scale) in named.items() if wanted(name)}
        places |= {heading: (heading, 1.0) for heading in headings if wanted(heading)}
    missing = [heading for heading, _ in places.values() if heading not in headings]
    if missing or TIME not in places:
        known = ", ".join(headings)[:200]
        raise TraceError(f"{path}: there is no column {(missing or [TIME])[0]}, there is: {known}")
    return places


def _numbers(path: Path, column: Any, name: str) -> FloatArray:
    """Values (N,); a date becomes seconds."""
    values = column.to_numpy()
    if np.issubdtype(values.dtype, np.datetime64):
        return np.asarray(values.astype("datetime64[ns]").astype(np.int64) * 1e-9, np.float64)
    try:
        numbers = np.array(values, np.float64)
    except (TypeError, ValueError) as error:
        raise TraceError(f"{path}: column {name} holds no numbers: {error}") from error
    if np.isinf(numbers).any() or (name == TIME and np.isnan(numbers).any()):
        raise TraceError(f"{path}: row {int(np.argmax(~np.isfinite(numbers)))} of {name} must be finite")
    return numbers
