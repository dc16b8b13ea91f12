"""One reader of measured data: recordings (MCAP), CSV and Parquet; everything that needs a trace
uses it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ir_msgs_py.modes import Mode
from ir_msgs_py.names import JOINT_NAMES, POWER_STATE
from ir_recorder.errors import RecorderError
from ir_recorder.reading.reader import TYPES, read_recording
from ir_recorder.reading.recording import JointSeries, PowerSeries, Recording
from ir_recorder.traces.bag_files import read_bag, types_of
from ir_recorder.traces.columns import TraceMapping, Wanted
from ir_recorder.traces.egm_files import read_egm
from ir_recorder.traces.kuka_files import read_kuka_trace, read_rsi
from ir_recorder.traces.table_files import read_csv, read_parquet
from ir_recorder.traces.trace import (
    EFFORT,
    ENDINGS,
    ENERGY,
    LOAD,
    MODE,
    POWER,
    TIME,
    VELOCITY,
    Trace,
)
from ir_values.arrays import FloatArray
from ir_values.errors import DescriptionError, InvalidValueError, listed
from ir_values.extensions import Registry

# Traces of a recording: the joints' and the meter's, each with its own instants.

_NUMBERS = frozenset(int(mode) for mode in Mode)


def recorded_traces(recording: Recording) -> tuple[Trace, ...]:
    """The joints' trace and the meter's, as far as they were recorded; RecorderError where neither
    was.
    """
    found = []
    if recording.joints is not None and len(recording.joints.time) > 1:
        found.append(joint_trace(recording.joints, f"{recording.path} joint states"))
    if recording.power is not None and len(recording.power.time) > 1:
        found.append(power_trace(recording.power, f"{recording.path} meter"))
    if not found:
        why = "; ".join(recording.problems) or "neither joint states nor the meter are in it"
        raise RecorderError(f"{recording.path}: {why[:500]}")
    return tuple(found)


def joint_trace(joints: JointSeries, source: str) -> Trace:
    """Positions, velocities and efforts by the names of the joints."""
    kinds = (("", joints.position), (VELOCITY, joints.velocity), (EFFORT, joints.effort))
    columns = {
        f"{name}{ending}": values[:, k].copy()
        for ending, values in kinds
        if np.isfinite(values).any()
        for k, name in enumerate(joints.names)
    }
    time, kept, problems = _increasing(joints.time, "joint states")
    return Trace(source, time, _rows(columns, kept), problems=problems)


def power_trace(power: PowerSeries, source: str) -> Trace:
    """Watts, joules and mode of the meter."""
    columns = {POWER: np.array(power.power), ENERGY: np.array(power.energy)}
    time, kept, problems = _increasing(power.time, "readings of the meter")
    modes = tuple(_mode_name(int(number)) for number in power.mode[kept])
    return Trace(source, time, _rows(columns, kept), MappingProxyType({MODE: modes}), problems)


def _mode_name(number: int) -> str:
    """A mode's name, those of transitions among them."""
    return Mode(number).name if number in _NUMBERS else f"mode {number}"


def _increasing(time: FloatArray, what: str) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Time without the rows that go back; which rows are kept; a sentence where some are not."""
    highest = np.maximum.accumulate(time)
    kept = np.concatenate([[True], time[1:] > highest[:-1]])
    lost = int(np.count_nonzero(~kept))
    return np.array(time[kept]), kept, (f"{lost} {what} go back in time: left out",) if lost else ()


def _rows(columns: Mapping[str, FloatArray], kept: FloatArray) -> Mapping[str, FloatArray]:
    return MappingProxyType({name: values[kept] for name, values in columns.items()})


ENDINGS_READ = (".csv", ".txt", ".parquet", ".mcap", ".db3", ".xml", ".dat", ".egm", ".pb")
ReadTraces = Callable[[Path], Sequence[Trace]]


def _made_reader(name: str, value: Any) -> ReadTraces:
    """The function of an entry point."""
    if not callable(value):
        raise InvalidValueError("must be a function of a path that returns traces")
    read: ReadTraces = value
    return read


READERS: Registry[ReadTraces] = Registry("ir_recorder.traces", {}, _made_reader)
"""Readers of installed packages, by the ending of the files that they read, without its dot."""

POWER_TYPE = TYPES[POWER_STATE]
_DIGITS = "0123456789"
_NAMES = (TIME, POWER, ENERGY, MODE, LOAD)


def read_traces(
    path: str | Path,
    mapping: TraceMapping | None = None,
    joint_names: Sequence[str] = JOINT_NAMES,
) -> tuple[Trace, ...]:
    """The traces of a file by its ending (ENDINGS_READ): one, or those of a recording.

    Without a mapping the columns that are read are `time`, `power`, `energy`, `mode`, `load`, and
    for each joint its name and `_velocity`, `_acceleration`, `_effort`. RecorderError or ReadError
    as a sentence.
    """
    path = Path(path)
    mapping = mapping or TraceMapping()
    ending = path.suffix.lower()
    wanted = _wanted(path, joint_names)
    tables = {
        ".csv": read_csv,
        ".txt": read_csv,
        ".parquet": read_parquet,
        ".dat": read_kuka_trace,
    }
    if ending in tables:
        found: tuple[Trace, ...] = (tables[ending](path, wanted, mapping, joint_names),)
    elif ending == ".xml":
        found = (read_rsi(path, joint_names),)
    elif ending in (".egm", ".pb"):
        found = (read_egm(path, joint_names),)
    elif ending == ".db3":
        found = _of_bag(path)
    elif ending == ".mcap":
        found = recorded_traces(read_recording(path))
    else:
        found = _installed(path, ending)
    return tuple(_shifted(trace, mapping) for trace in found)


def _of_bag(path: Path) -> tuple[Trace, ...]:
    """Joints and meter of a bag of this project; of any other the joint states."""
    if POWER_TYPE in types_of(path):
        return recorded_traces(read_recording(path))
    return (read_bag(path),)


def _installed(path: Path, ending: str) -> tuple[Trace, ...]:
    """Traces by the reader of an installed package. RecorderError where there is none, or it can't
    be used.
    """
    endings = [f".{each}" for each in READERS]
    if ending not in endings:
        known = listed((*ENDINGS_READ, *endings))
        raise RecorderError(f"{path}: traces are read from {known}")
    try:
        return tuple(READERS[ending.removeprefix(".")](path))
    except DescriptionError as error:
        raise RecorderError(f"{path}: {error}") from error


def column_names(joint_names: Sequence[str]) -> frozenset[str]:
    """The columns that are read of a trace of a robot with these joints."""
    return frozenset((*_NAMES, *(f"{name}{each}" for name in joint_names for each in ENDINGS)))


def _wanted(path: Path, joint_names: Sequence[str]) -> Wanted:
    """Whether a column is read. RecorderError for a joint that the robot doesn't have, by its
    number.
    """
    known = column_names(joint_names)
    stems = {name.rstrip(_DIGITS) for name in joint_names if name[-1:].isdecimal()}

    def wanted(name: str) -> bool:
        if name in known:
            return True
        if name[-1:].isdecimal() and name.rstrip(_DIGITS) in stems:
            there = ", ".join(joint_names)
            raise RecorderError(f"{path}: {name[:40]} is no joint of the robot, which has {there}")
        return False

    return wanted


def _shifted(trace: Trace, mapping: TraceMapping) -> Trace:
    """On the clock that the mapping gives; as it is where it gives none."""
    return (
        trace
        if mapping.clock_offset != mapping.clock_offset
        else trace.shifted(mapping.clock_offset)
    )
