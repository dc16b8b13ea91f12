"""One reader of measured data: recordings (MCAP), CSV and Parquet; everything that needs a trace
uses it.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ir_msgs_py.modes import Mode
from ir_msgs_py.names import JOINT_NAMES, POWER_STATE
from ir_recorder.errors import ReadError, RecorderError
from ir_recorder.reading.cdr import (
    MOST_JOINTS,
    Columns,
    by_name,
    fitting,
    joint_groups,
    one_robot,
)
from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.reading.reader import TYPES, read_recording
from ir_recorder.reading.recording import JointSeries, PowerSeries, Recording
from ir_recorder.traces.columns import TraceMapping, Wanted
from ir_recorder.traces.egm_files import read_egm
from ir_recorder.traces.kuka_files import read_kuka_trace, read_rsi
from ir_recorder.traces.table_files import opened, read_csv, read_parquet
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
from ir_values.arrays import BoolArray, FloatArray
from ir_values.errors import DescriptionError, InvalidValueError, listed
from ir_values.extensions import Registry

# Traces of ROS 2 bags of others, in SQLite (`.db3`) or as MCAP: the joint states of one topic.

JOINT_STATE = "sensor_msgs/msg/JointState"
_SCHEMA = """\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_MOST = 5_000_000  # messages
_JOINT_STATES = "joint_states"  # what ROS calls the topic; commands have other names
_FIELDS = (("position", ""), ("velocity", VELOCITY), ("effort", EFFORT))


def read_bag(path: Path, mapping: TraceMapping | None = None) -> Trace:
    """The joint states of a bag, by their stamps: of the mapping's topic, with the names that it
    gives where they have none. RecorderError where there are none, or it is no bag.
    """
    mapping = mapping or TraceMapping()
    os.close(opened(path))  # of a bounded size, and a regular file
    read = _mcap_messages if path.suffix.lower() == ".mcap" else _sqlite_messages
    rows, problems = read(path, mapping.topic)
    fit = fitting([data for _, data in rows], JOINT_STATE, _SCHEMA)
    if not fit:
        raise RecorderError(
            f"{path}: none of its {len(rows)} messages is a {JOINT_STATE} in little-endian CDR"
        )

    # one robot's messages, or those of joints without names
    columns = Columns([rows[k][1] for k in fit], JOINT_STATE, _SCHEMA)
    groups = joint_groups(columns)
    has_names = list(groups) != [()]
    if not has_names:
        _check_names(path, columns, mapping.joints)
    try:
        robot = one_robot(groups) if has_names else [()]
    except ReadError as error:
        raise RecorderError(f"{path}: {error}") from error
    for names, messages in groups.items():
        if names not in robot:
            listed = ", ".join(names)[:200] or "no joint"
            problems.append(f"{len(messages)} joint states of {listed}: left out")
    if len(fit) < len(rows):
        problems.append(f"{len(rows) - len(fit)} messages are no {JOINT_STATE}: left out")
    own = np.sort(np.concatenate([groups[names] for names in robot]))
    rows = [rows[fit[k]] for k in own]
    columns = Columns([data for _, data in rows], JOINT_STATE, _SCHEMA)

    # by the stamps, or by when messages were recorded where these are all 0
    stamps = columns.stamps()
    nanoseconds = stamps if stamps.any() else np.array([time for time, _ in rows])
    time = (nanoseconds - nanoseconds[0]) * 1e-9
    goes_on = time[1:] > np.maximum.accumulate(time)[:-1]
    kept = np.concatenate([[True], goes_on])
    _check_clock(path, time, kept)
    problems += _unused(robot[0], mapping.joints)
    found = _joint_columns(columns, robot[0], mapping.joints, kept)
    lost = int(np.count_nonzero(~kept))
    if lost:
        problems.append(f"{lost} joint states go back in time: left out")
    return Trace(str(path), time[kept], MappingProxyType(found), problems=tuple(problems))


def _joint_columns(
    columns: Columns, own_names: Sequence[str], given: Sequence[str], kept: BoolArray
) -> dict[str, FloatArray]:
    """Positions, velocities and efforts of joints in the messages `kept` (N,), by the names of the
    trace's columns; by the messages' own names, else in the order of the given ones.
    """
    names = own_names or given
    paths = [field for field, _ in _FIELDS]
    if own_names:
        fields = by_name(columns, names, *paths)
    else:
        fields = [columns.numbers(path, len(names)) for path in paths]
    found = {}
    for (_, ending), values in zip(_FIELDS, fields, strict=True):
        if np.isfinite(values).any():
            for k, name in enumerate(names):
                found[f"{name}{ending}"] = values[kept, k].copy()
    return found


def types_of(path: Path) -> frozenset[str]:
    """Types of the topics of a bag. RecorderError where it is none."""
    os.close(opened(path))
    try:
        with sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True) as bag:
            return frozenset(str(row[0]) for row in bag.execute("SELECT type FROM topics"))
    except sqlite3.Error as error:
        raise RecorderError(f"{path}: can't be read as a bag: {error}") from error


def _unused(named: Sequence[str], given: Sequence[str]) -> list[str]:
    """A sentence where a mapping gives names to states that have names."""
    if not (named and given):
        return []
    return [f"joints of the mapping are not used, its states name {', '.join(named)[:200]}"]


def _check_names(path: Path, columns: Columns, joints: Sequence[str]) -> None:
    """RecorderError where nobody says which joints these states are of, or of another number."""
    if not joints:
        raise RecorderError(
            f"{path}: its joint states name no joint: a mapping (--mapping) gives their names in "
            "order, as joints: [joint_a1, joint_a2]"
        )
    lengths = np.isfinite(columns.numbers("position", MOST_JOINTS)).sum(axis=1)
    if (lengths != len(joints)).any():
        other = int(lengths[lengths != len(joints)][0])
        raise RecorderError(
            f"{path}: a joint state has {other} positions, the mapping names {len(joints)} joints"
        )


_BACK = 10.0  # usual steps: messages that came late, more is another clock


def _check_clock(path: Path, time: FloatArray, kept: FloatArray) -> None:
    """RecorderError where stamps (N,) go back by more than late messages do."""
    usual = float(np.median(np.diff(time[kept]))) if np.count_nonzero(kept) > 1 else 0.0
    back = np.maximum.accumulate(time) - time
    worst = int(back.argmax())
    if back[worst] > _BACK * usual and back[worst] > 0.0:
        raise RecorderError(
            f"{path}: the stamp of joint state {worst + 1} is {back[worst]:.3g} s before one that "
            f"came earlier, at most {_BACK * usual:.3g} s ({_BACK:g} usual steps) are put down to "
            "late messages: did a clock move?"
        )


def _sqlite_messages(path: Path, wanted: str) -> tuple[list[tuple[int, bytes]], list[str]]:
    """Times [ns] and bytes of the joint states that are read, and sentences."""
    try:
        with sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True) as bag:
            return _messages(bag, path, wanted)
    except sqlite3.Error as error:
        raise RecorderError(f"{path}: can't be read as a bag: {error}") from error


def _messages(
    bag: sqlite3.Connection, path: Path, wanted: str
) -> tuple[list[tuple[int, bytes]], list[str]]:
    """The same of an open bag."""
    topics = [
        _Topic(number, str(name), str(kind), count)
        for number, name, kind, count in bag.execute(
            "SELECT t.id, t.name, t.type, COUNT(m.id) FROM topics t JOIN messages m "
            "ON m.topic_id = t.id GROUP BY t.id"
        )
    ]
    topic, problems = _chosen(topics, path, wanted)
    query = "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp, id"
    rows = bag.execute(query, (topic.number,))
    return [(int(time), bytes(data)) for time, data in rows], problems


def _mcap_messages(path: Path, wanted: str) -> tuple[list[tuple[int, bytes]], list[str]]:
    """Times [ns] and bytes of the joint states that are read of a file in MCAP, and sentences;
    ReadError where it is none.
    """
    raw = read_raw(path)
    topics = [
        _Topic(number, each.topic, each.type, len(each.messages))
        for number, each in enumerate(raw.channels)
        if each.messages and each.message_encoding == "cdr"
    ]
    problems = list(raw.problems)
    problems += [
        f"{each.topic[:100]} is {each.message_encoding[:40]}, not cdr: left out"
        for each in raw.channels
        if each.messages and each.message_encoding != "cdr"
    ]
    topic, said = _chosen(topics, path, wanted)
    channel = raw.channels[topic.number]
    times = channel.log_time.tolist()
    return list(zip(times, channel.messages, strict=True)), problems + said


@dataclass(frozen=True)
class _Topic:
    """A topic of a bag with messages: its number there, name, type, and how many it has."""

    number: int
    name: str
    kind: str
    count: int


def _chosen(topics: list[_Topic], path: Path, wanted: str) -> tuple[_Topic, list[str]]:
    """The joint states that are read: of the wanted topic, else that of their usual name, else the
    only one; and a sentence on what else is in the bag. RecorderError where several could be it, as
    commands are of the same type.
    """
    topics = sorted(topics, key=lambda each: (-each.count, each.number))
    states = [each for each in topics if each.kind == JOINT_STATE]
    if not states:
        raise RecorderError(f"{path}: there are no messages of {JOINT_STATE} in it")
    named = [each for each in states if each.name.rpartition("/")[2] == _JOINT_STATES]
    if wanted:
        named = [each for each in states if each.name.strip("/") == wanted.strip("/")]
    several = [each.name[:100] for each in named or states]
    if wanted and not named:
        raise RecorderError(
            f"{path}: there is no topic {wanted[:100]} of {JOINT_STATE}, there is "
            f"{listed(several, 8)}"
        )
    if len(several) > 1:
        raise RecorderError(
            f"{path}: {listed(several, 8)} are all of {JOINT_STATE}, states or commands: a mapping "
            "(--mapping) says which was measured, as topic: NAME"
        )
    topic = (named or states)[0]
    if topic.count > _MOST:
        raise RecorderError(f"{path}: has {topic.count} joint states, at most {_MOST} are read")
    others = [f"{each.name} ({each.kind})"[:100] for each in topics if each != topic]
    if others:
        return topic, [f"read is {topic.name[:100]}; topics that are not: {listed(others, 8)}"]
    if topic.name.rpartition("/")[2] != _JOINT_STATES:
        return topic, [f"read is {topic.name[:100]}, the only topic of {JOINT_STATE}"]
    return topic, []


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
        found = _of_bag(path, mapping)
    elif ending == ".mcap":
        found = _of_mcap(path, mapping)
    else:
        found = _installed(path, ending)
    return tuple(_shifted(trace, mapping) for trace in found)


def _of_bag(path: Path, mapping: TraceMapping) -> tuple[Trace, ...]:
    """Joints and meter of a bag of this project; of any other the joint states."""
    if POWER_TYPE in types_of(path):
        return recorded_traces(read_recording(path))
    return (read_bag(path, mapping),)


def _of_mcap(path: Path, mapping: TraceMapping) -> tuple[Trace, ...]:
    """The same of a file in MCAP."""
    recording = read_recording(path)
    if is_own(recording):
        return recorded_traces(recording)
    return (read_bag(path, mapping),)


def is_own(recording: Recording) -> bool:
    """Whether it is a recording of this project, not a bag of joint states of another."""
    return recording.power is not None or bool(recording.cell_yaml)


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
