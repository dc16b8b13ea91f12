"""Logs of ABB's Externally Guided Motion: the robot's datagrams (EgmRobot) in one file.

The messages are protobuf. They stand one after the other, each with its length before it (as a
varint, or in 4 bytes) or without; the way that explains the whole file is taken. Joints are in
degrees and the header's time in ms, as ABB's egm.proto says: in 32 bits, so it begins again every
49.7 days.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ir_recorder.errors import RecorderError
from ir_recorder.traces.table_files import VALUES_MAX, opened
from ir_recorder.traces.trace import Trace
from ir_values.arrays import FloatArray

_VARINT = 0
_EIGHT = 1
_BYTES = 2
_FOUR = 5
_HEADER = 1  # of EgmRobot; a sensor's message has what it plans in place of 2
_FEEDBACK = 2
_SEQUENCE = 1  # of EgmHeader
_TIME = 2
_TYPE = 3
_JOINTS = 1  # of EgmFeedBack
_EXTERNAL = 3
_CLOCK = 4
_DATA = 2  # type of the robot's messages
_MS = 1e-3
_WRAP = 2**32 * _MS  # s after which the header's time begins again
_WRAP_NEAR = (
    60.0  # s: a step back by _WRAP within this is a wrap, messages missing around it or not
)
# usual steps that a message may come late: datagrams overtake each other by a few, and where the
# clock goes back farther the robot began anew
_LATE = 10
_LENGTH_MAX = 65_535  # bytes of a datagram
_TAG_OF_HEADER = b"\x0a"

Fields = list[tuple[int, int, int | bytes]]
"""Number, wire type and value of each field of a message."""


class _NoMessageError(Exception):
    """The bytes are no protobuf."""


@dataclass(frozen=True)
class _Row:
    number: int
    time: float  # s of the robot's clock
    joints: tuple[float, ...]  # deg
    external: tuple[float, ...]  # deg or mm


def read_egm(path: Path, joint_names: Sequence[str]) -> Trace:
    """The joints that the robot reported; RecorderError where the file holds no such messages, or
    other joints.
    """
    with os.fdopen(opened(path), "rb") as stream:
        content = stream.read()
    rows, how, cut, others = _rows(content, path)
    if len(rows) * len(joint_names) > VALUES_MAX:
        raise RecorderError(f"{path}: more than {VALUES_MAX} values, the limit")
    _check_joints(rows, joint_names, path)
    time, wraps = _unwrapped(np.array([row.time for row in rows]))
    late = _late(time, rows, path)
    order = np.argsort(time, kind="stable")
    is_later = np.concatenate([[True], np.diff(time[order]) > 0.0])
    kept = order[is_later]
    steps = np.diff(np.sort([row.number for row in rows]))
    missing = int((steps[steps > 1] - 1).sum())

    notes = [f"{len(rows)} messages of EGM {how}: joints in degrees, as ABB's egm.proto gives them"]
    if cut:
        notes.append(f"{cut} bytes at the end are no whole message: left out")
    if others:
        notes.append(f"{others} messages are not the robot's (EgmRobot with feedback): left out")
    if wraps:
        notes.append(f"the time in ms begins again at 2^32: {wraps} times, taken as going on")
    if late:
        notes.append(f"{late} messages came late: put in order of time")
    if len(kept) < len(rows):
        notes.append(f"{len(rows) - len(kept)} messages have the time of another one: left out")
    if missing:
        notes.append(f"{missing} messages are missing by their numbers")
    if len({row.external for row in rows}) > 1:
        notes.append("external joints move and are not read")
    joints = np.radians([rows[k].joints for k in kept])
    columns = {name: np.ascontiguousarray(joints[:, k]) for k, name in enumerate(joint_names)}
    seconds = time[kept] - time[kept[0]]
    return Trace(str(path), seconds, MappingProxyType(columns), problems=tuple(notes))


def _check_joints(rows: Sequence[_Row], joint_names: Sequence[str], path: Path) -> None:
    """RecorderError where a message has other joints than the robot, or none that are numbers."""
    for row in rows:
        if len(row.joints) != len(joint_names) or not np.isfinite(row.joints).all():
            raise RecorderError(
                f"{path}: message {row.number} of EGM has the joints {list(row.joints)}, must be "
                f"{len(joint_names)} finite numbers: {', '.join(joint_names)}"
            )


def _unwrapped(time: FloatArray) -> tuple[FloatArray, int]:
    """Time (N,) s that goes on where the clock of 32 bits begins again, and how often it does."""
    steps = np.diff(time)
    turns = np.zeros(len(time))
    for sign in (1.0, -1.0):  # a message from before the wrap may come after it
        turns[1:] += sign * (np.abs(steps + sign * _WRAP) < _WRAP_NEAR)
    counted = np.cumsum(turns)
    return time + _WRAP * counted, int(counted.max(initial=0.0))


def _late(time: FloatArray, rows: Sequence[_Row], path: Path) -> int:
    """How many messages came after one of a later time (N,) s. RecorderError where one is later
    than datagrams come: the clock began anew there.
    """
    latest = np.maximum.accumulate(time)
    steps = np.diff(np.unique(time))
    usual = float(np.median(steps)) if len(steps) else 0.0
    back = np.flatnonzero(latest - time > _LATE * usual + 0.5 * _MS)
    if len(back):
        k = int(back[0])
        raise RecorderError(
            f"{path}: message {k + 1} of the robot (number {rows[k].number}): time is "
            f"{time[k]:.12g} s, {latest[k]:.12g} s came before: messages come late by "
            f"{_LATE} usual steps at most, so the clock began anew; a file holds one session"
        )
    return int(np.count_nonzero(time < latest))


def _rows(content: bytes, path: Path) -> tuple[list[_Row], str, int, int]:
    """Messages of the robot, how they stand in the file, bytes that are left, other messages."""
    ways: tuple[tuple[str, Callable[[bytes], Iterator[tuple[bytes, int]]]], ...] = (
        ("with their lengths as varints", lambda text: _prefixed(text, _varint)),
        ("with their lengths in 4 bytes", lambda text: _prefixed(text, _fixed("<I"))),
        ("with their lengths in 4 bytes, big-endian", lambda text: _prefixed(text, _fixed(">I"))),
        ("one after the other", _bare),
    )
    for how, way in ways:
        rows = []
        others = 0
        end = 0
        try:
            for message, after in way(content):
                row = _row_of_message(_fields(message))
                end = after
                others += row is None
                rows += [row] if row is not None else []
        except _NoMessageError:
            continue
        if rows and len(content) - end <= min(_LENGTH_MAX, end):
            return rows, how, len(content) - end, others
        if others and not rows:
            raise RecorderError(
                f"{path}: its {others} messages of EGM have no feedback of the robot: these are "
                "what a sensor sends (EgmSensor), or empty"
            )
    raise RecorderError(
        f"{path}: is no log of EGM: messages EgmRobot one after the other, each with its length "
        "before it or without"
    )


def _prefixed(
    content: bytes, length: Callable[[bytes, int], tuple[int, int]]
) -> Iterator[tuple[bytes, int]]:
    """Messages and where each ends; the last one may be cut."""
    at = 0
    while at < len(content):
        try:
            size, begin = length(content, at)
        except (IndexError, struct.error):
            return
        if not 0 < size <= _LENGTH_MAX:
            raise _NoMessageError
        if begin + size > len(content):
            return
        at = begin + size
        yield content[begin:at], at


def _fixed(layout: str) -> Callable[[bytes, int], tuple[int, int]]:
    return lambda content, at: (struct.unpack_from(layout, content, at)[0], at + 4)


def _bare(content: bytes) -> Iterator[tuple[bytes, int]]:
    """Messages without lengths: each begins with its header."""
    begin = 0
    at = 0
    while at < len(content):
        try:
            _, _, _, after = _field(content, at)
        except IndexError:
            return
        if content[at : at + 1] == _TAG_OF_HEADER and at > begin:
            yield content[begin:at], at
            begin = at
        at = after
    yield content[begin:at], at


def _row_of_message(message: Fields) -> _Row | None:
    """What a message of the robot says, None of another one. Raises _NoMessageError."""
    header = _inside(message, _HEADER)
    feedback = _inside(message, _FEEDBACK)
    if header is None:
        raise _NoMessageError
    if feedback is None or _whole(header, _TYPE, _DATA) != _DATA:
        return None
    joints = _doubles(_inside(feedback, _JOINTS))
    if not joints:
        return None
    clock = _inside(feedback, _CLOCK)
    time = _whole(header, _TIME, 0) * _MS
    if clock is not None:
        time = _whole(clock, 1, 0) + 1e-6 * _whole(clock, 2, 0)
    external = _doubles(_inside(feedback, _EXTERNAL))
    return _Row(_whole(header, _SEQUENCE, 0), time, joints, external)


def _inside(message: Fields, number: int) -> Fields | None:
    """The message in a field, None where there is none."""
    for each, wire, value in message:
        if each == number and wire == _BYTES and isinstance(value, bytes):
            return _fields(value)
    return None


def _whole(message: Fields, number: int, default: int) -> int:
    found = (value for each, wire, value in message if each == number and wire == _VARINT)
    value = next(found, default)
    return value if isinstance(value, int) else default


def _doubles(message: Fields | None) -> tuple[float, ...]:
    """The repeated doubles of field 1, packed or not."""
    found: list[float] = []
    for number, wire, value in message or []:
        if number != 1 or not isinstance(value, bytes) or wire not in (_EIGHT, _BYTES):
            continue
        if len(value) % 8:
            raise _NoMessageError
        found += struct.unpack(f"<{len(value) // 8}d", value)
    return tuple(found)


def _fields(message: bytes) -> Fields:
    """All fields of a message. Raises _NoMessageError."""
    found: Fields = []
    at = 0
    while at < len(message):
        try:
            number, wire, value, at = _field(message, at)
        except IndexError as error:
            raise _NoMessageError from error
        found.append((number, wire, value))
    return found


def _field(content: bytes, at: int) -> tuple[int, int, int | bytes, int]:
    """Number, wire type and value of the field that begins here, and where it ends; IndexError
    where it is cut. Raises _NoMessageError.
    """
    tag, at = _varint(content, at)
    number = tag >> 3
    wire = tag & 7
    if number == 0 or wire not in (_VARINT, _EIGHT, _BYTES, _FOUR):
        raise _NoMessageError
    if wire == _VARINT:
        value, at = _varint(content, at)
        return number, wire, value, at
    size = {_EIGHT: 8, _FOUR: 4}.get(wire, 0)
    if wire == _BYTES:
        size, at = _varint(content, at)
    if at + size > len(content):
        raise IndexError
    return number, wire, content[at : at + size], at + size


def _varint(content: bytes, at: int) -> tuple[int, int]:
    """A number and where it ends. IndexError where it is cut."""
    value = 0
    for shift in range(0, 70, 7):
        byte = content[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise _NoMessageError
