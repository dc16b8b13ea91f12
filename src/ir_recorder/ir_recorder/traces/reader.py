"""One reader of measured data: recordings (MCAP), CSV and Parquet; everything that needs a trace
uses it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ir_msgs_py.names import JOINT_NAMES
from ir_recorder.errors import TraceError
from ir_recorder.read.reader import read_recording
from ir_recorder.traces.csv_file import read_csv
from ir_recorder.traces.headings import Wanted
from ir_recorder.traces.mapping import TraceMapping
from ir_recorder.traces.parquet_file import read_parquet
from ir_recorder.traces.recorded import recorded_traces
from ir_recorder.traces.trace import ENDINGS, ENERGY, LOAD, MODE, POWER, TIME, Trace

_DIGITS = "0123456789"
_NAMES = (TIME, POWER, ENERGY, MODE, LOAD)


def read_traces(
    path: str | Path,
    mapping: TraceMapping | None = None,
    joint_names: Sequence[str] = JOINT_NAMES,
) -> tuple[Trace, ...]:
    """The traces of a file by its ending (.csv, .txt, .parquet, .mcap): one, or those of a
    recording.

    Without a mapping the columns that are read are `time`, `power`, `energy`, `mode`, `load`, and
    for each joint its name and `_velocity`, `_acceleration`, `_effort`. TraceError or ReadError as
    a sentence.
    """
    path = Path(path)
    mapping = mapping or TraceMapping()
    ending = path.suffix.lower()
    wanted = _wanted(path, joint_names)
    if ending in (".csv", ".txt"):
        return (_shifted(read_csv(path, wanted, mapping), mapping),)
    if ending == ".parquet":
        return (_shifted(read_parquet(path, wanted, mapping), mapping),)
    if ending == ".mcap":
        return tuple(_shifted(trace, mapping) for trace in recorded_traces(read_recording(path)))
    raise TraceError(f"{path}: traces are read from .csv, .parquet and .mcap")


def column_names(joint_names: Sequence[str]) -> frozenset[str]:
    """The columns that are read of a trace of a robot with these joints."""
    return frozenset((*_NAMES, *(f"{name}{each}" for name in joint_names for each in ENDINGS)))


def _wanted(path: Path, joint_names: Sequence[str]) -> Wanted:
    """Whether a column is read. TraceError for a joint that the robot doesn't have, by its
    number.
    """
    known = column_names(joint_names)
    stems = {name.rstrip(_DIGITS) for name in joint_names if name[-1:].isdecimal()}

    def wanted(name: str) -> bool:
        if name in known:
            return True
        if name[-1:].isdecimal() and name.rstrip(_DIGITS) in stems:
            there = ", ".join(joint_names)
            raise TraceError(f"{path}: {name[:40]} is no joint of the robot, which has {there}")
        return False

    return wanted


def _shifted(trace: Trace, mapping: TraceMapping) -> Trace:
    """On the clock that the mapping gives; as it is where it gives none."""
    return (
        trace
        if mapping.clock_offset != mapping.clock_offset
        else trace.shifted(mapping.clock_offset)
    )
