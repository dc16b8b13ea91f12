"""One reader of measured data: recordings (MCAP), CSV and Parquet; everything that needs a trace uses it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ir_msgs_py.names import JOINT_NAMES
from ir_recorder.errors import TraceError
from ir_recorder.read.reader import read_recording
from ir_recorder.traces.csv_file import read_csv
from ir_recorder.traces.mapping import TraceMapping
from ir_recorder.traces.parquet_file import read_parquet
from ir_recorder.traces.recorded import recorded_traces
from ir_recorder.traces.trace import ENDINGS, ENERGY, LOAD, MODE, POWER, TIME, Trace

_NAMES = (TIME, POWER, ENERGY, MODE, LOAD)


def read_traces(
    path: str | Path,
    mapping: TraceMapping | None = None,
    joint_names: Sequence[str] = JOINT_NAMES,
) -> tuple[Trace, ...]:
    """The traces of a file by its ending (.csv, .txt, .parquet, .mcap): one, or those of a recording.

    Without a mapping the columns that are read are `time`, `power`, `energy`, `mode`, `load`, and for each
    joint its name and `_velocity`, `_acceleration`, `_effort`. TraceError or ReadError as a sentence.
    """
    path, mapping = Path(path), mapping or TraceMapping()
    ending = path.suffix.lower()
    known = {*_NAMES, *(f"{name}{each}" for name in joint_names for each in ENDINGS)}
    if ending in (".csv", ".txt"):
        return (_shifted(read_csv(path, known.__contains__, mapping), mapping),)
    if ending == ".parquet":
        return (_shifted(read_parquet(path, known.__contains__, mapping), mapping),)
    if ending == ".mcap":
        return tuple(_shifted(trace, mapping) for trace in recorded_traces(read_recording(path)))
    raise TraceError(f"{path}: traces are read from .csv, .parquet and .mcap")


def _shifted(trace: Trace, mapping: TraceMapping) -> Trace:
    """On the clock that the mapping gives; as it is where it gives none."""
    return trace if mapping.clock_offset != mapping.clock_offset else trace.shifted(mapping.clock_offset)
