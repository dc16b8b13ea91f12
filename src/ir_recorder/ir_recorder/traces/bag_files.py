"""Traces of ROS 2 bags in SQLite (`.db3`): the joint states of the topic that has most of them."""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ir_recorder.errors import RecorderError
from ir_recorder.reading.cdr import Columns
from ir_recorder.traces.table_files import opened
from ir_recorder.traces.trace import EFFORT, VELOCITY, Trace

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
    columns = Columns([data for _, data in rows], JOINT_STATE, _SCHEMA)
    stamps = columns.stamps()
    nanoseconds = np.array([time for time, _ in rows]) if not stamps.any() else stamps
    names = _names(columns, path)
    time = (nanoseconds - nanoseconds[0]) * 1e-9
    kept = np.concatenate([[True], time[1:] > np.maximum.accumulate(time)[:-1]])
    found = {}
    for field, ending in _FIELDS:
        values = columns.numbers(field, len(names))
        if np.isfinite(values).any():
            for k, name in enumerate(names):
                found[f"{name}{ending}"] = values[kept, k].copy()
    lost = int(np.count_nonzero(~kept))
    problems = (f"{lost} joint states go back in time: left out",) if lost else ()
    return Trace(str(path), time[kept], MappingProxyType(found), problems=problems)


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


def _names(columns: Columns, path: Path) -> list[str]:
    """Names of the joints, which all messages give in one order."""
    columns.require("position")
    width = max(columns.lengths("position"), default=0)
    names = [columns.texts(f"name[{k}]") for k in range(width)]
    if not names or any(len(set(each)) != 1 for each in names):
        raise RecorderError(f"{path}: its joint states name other joints from message to message")
    return [each[0] for each in names]
