"""Traces of ROS 2 bags in SQLite (`.db3`): the joint states of the topic that has most of them."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ir_recorder.errors import RecorderError
from ir_recorder.reading.cdr import Columns, fitting, joint_groups
from ir_recorder.traces.table_files import opened
from ir_recorder.traces.trace import EFFORT, VELOCITY, Trace
from ir_values.arrays import IntArray

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
_FIELDS = (("position", ""), ("velocity", VELOCITY), ("effort", EFFORT))


def read_bag(path: Path) -> Trace:
    """The joint states of a bag, by their stamps; RecorderError where it has none, or is none."""
    os.close(opened(path))  # of a bounded size, and a regular file
    try:
        with sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True) as bag:
            rows = _messages(bag, path)
    except sqlite3.Error as error:
        raise RecorderError(f"{path}: can't be read as a bag: {error}") from error
    fit = fitting([data for _, data in rows], JOINT_STATE, _SCHEMA)
    if not fit:
        raise RecorderError(
            f"{path}: none of its {len(rows)} messages is a {JOINT_STATE} in little-endian CDR"
        )
    columns = Columns([rows[k][1] for k in fit], JOINT_STATE, _SCHEMA)
    groups = joint_groups(columns)
    names = _names(groups, path)
    taken = [fit[k] for k in groups[names]]
    problems = [
        f"{len(groups[each])} joint states of {', '.join(each)[:200] or 'no joint'}: left out"
        for each in groups
        if each != names
    ]
    if len(fit) < len(rows):
        problems.append(f"{len(rows) - len(fit)} messages are no {JOINT_STATE}: left out")
    rows = [rows[k] for k in taken]
    columns = Columns([data for _, data in rows], JOINT_STATE, _SCHEMA)
    stamps = columns.stamps()
    nanoseconds = np.array([time for time, _ in rows]) if not stamps.any() else stamps
    time = (nanoseconds - nanoseconds[0]) * 1e-9
    kept = np.concatenate([[True], time[1:] > np.maximum.accumulate(time)[:-1]])
    found = {}
    for field, ending in _FIELDS:
        values = columns.numbers(field, len(names))
        if np.isfinite(values).any():
            for k, name in enumerate(names):
                found[f"{name}{ending}"] = values[kept, k].copy()
    lost = int(np.count_nonzero(~kept))
    problems += [f"{lost} joint states go back in time: left out"] if lost else []
    return Trace(str(path), time[kept], MappingProxyType(found), problems=tuple(problems))


def types_of(path: Path) -> frozenset[str]:
    """Types of the topics of a bag. RecorderError where it is none."""
    os.close(opened(path))
    try:
        with sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True) as bag:
            return frozenset(str(row[0]) for row in bag.execute("SELECT type FROM topics"))
    except sqlite3.Error as error:
        raise RecorderError(f"{path}: can't be read as a bag: {error}") from error


def _messages(bag: sqlite3.Connection, path: Path) -> list[tuple[int, bytes]]:
    """Times [ns] and bytes of the topic that has most joint states."""
    topics = bag.execute(
        "SELECT t.id, COUNT(m.id) FROM topics t JOIN messages m ON m.topic_id = t.id "
        "WHERE t.type = ? GROUP BY t.id ORDER BY COUNT(m.id) DESC, t.id",
        (JOINT_STATE,),
    ).fetchall()
    if not topics:
        raise RecorderError(f"{path}: there are no messages of {JOINT_STATE} in it")
    topic, count = topics[0]
    if count > _MOST:
        raise RecorderError(f"{path}: has {count} joint states, at most {_MOST} are read")
    query = "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp, id"
    return [(int(time), bytes(data)) for time, data in bag.execute(query, (topic,))]


def _names(groups: Mapping[tuple[str, ...], IntArray], path: Path) -> tuple[str, ...]:
    """The joints of the robot: most joints are named by one kind of messages, in one order."""
    first, *others = groups or ((),)
    if not first or any(len(each) == len(first) for each in others):
        raise RecorderError(f"{path}: its joint states name other joints from message to message")
    return first
