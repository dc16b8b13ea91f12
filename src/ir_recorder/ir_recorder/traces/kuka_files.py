"""Logs of KUKA controllers: packets of RSI as XML, and traces (a header `.dat` with its `.r64`),
also those that keep one file for each axis.

RSI sends the axes in degrees (AIPos) and the time in ms (IPOC). A trace is a data set of DIAdem:
the header names every channel with its unit, and where its numbers stand in the binary file.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ir_recorder.errors import RecorderError
from ir_recorder.traces.columns import TraceMapping, Wanted
from ir_recorder.traces.table_files import VALUES_MAX, opened, table_trace
from ir_recorder.traces.trace import Trace
from ir_values.arrays import FloatArray, number_of
from ir_values.errors import shown

# RSI: <Rob Type="KUKA"> .. <AIPos A1="0.0" .. /> .. <IPOC>4208163632</IPOC></Rob>, again and again.

_PACKET = re.compile(r"<Rob\b.*?</Rob>", re.DOTALL)
_AXES = re.compile(r"<AIPos\b([^>]*)>")
_EXTERNAL = re.compile(r"<EIPos\b([^>]*)>")
_VALUE = re.compile(r"""\b([AE]\d)\s*=\s*["']([^"']*)["']""")
_CLOCK = re.compile(r"<IPOC>\s*([^<]*?)\s*</IPOC>")
_MS = 1e-3


def read_rsi(path: Path, joint_names: Sequence[str]) -> Trace:
    """The axes of packets of RSI; RecorderError with the packet and its line where one lacks a
    value.
    """
    text = _content(path).decode("utf-8-sig", errors="replace")
    rows = []
    external: dict[str, set[str]] = {}
    end = 0
    line = 1
    for packet in _PACKET.finditer(text):
        line += text.count("\n", end, packet.start())
        end = packet.start()
        rows.append(_packet(packet[0], len(joint_names), f"{path}:{line}"))
        for found in _EXTERNAL.findall(packet[0]):
            for name, value in _VALUE.findall(found):
                external.setdefault(name, set()).add(value)
    if not rows:
        raise RecorderError(f"{path}: there is no packet of RSI in it: <Rob> .. </Rob> with IPOC")
    values = np.array(rows)
    kept = np.concatenate([[True], (np.diff(values, axis=0) != 0.0).any(axis=1)])
    notes = [f"{len(rows)} packets of RSI: AIPos in degrees, IPOC in ms"]
    if not kept.all():
        notes.append(f"{np.count_nonzero(~kept)} packets repeat the one before: left out")
    moving = [name for name, seen in external.items() if len(seen) > 1]
    if moving:
        notes.append(f"the external axes {', '.join(moving)} move and are not read")
    time = (values[kept, 0] - values[0, 0]) * _MS
    columns = {name: np.radians(values[kept, k]) for k, name in enumerate(joint_names, 1)}
    return Trace(str(path), time, MappingProxyType(columns), problems=tuple(notes))


def _packet(text: str, count: int, where: str) -> list[float]:
    """IPOC and the axes of one packet. Raises RecorderError."""
    clock = _CLOCK.search(text)
    axes = _AXES.search(text)
    found = {} if axes is None else dict(_VALUE.findall(axes[1]))
    wanted = {"IPOC": clock[1] if clock else None}
    wanted |= {f"AIPos {name}": found.get(name) for name in (f"A{k + 1}" for k in range(count))}
    values = []
    for name, value in wanted.items():
        if value is None:
            raise RecorderError(f"{where}: this packet of RSI has no {name}")
        try:
            values.append(number_of(value))
        except ValueError:
            values.append(math.nan)
        if not math.isfinite(values[-1]):
            raise RecorderError(f"{where}: {name} is {shown(value)}, it must be a finite number")
    return values


# A trace: #BEGINCHANNELHEADER, then lines "number,value" for each channel.

_NAME = "200"
_UNIT = "202"
_KIND = "210"
_FILE = "211"
_STORED = "213"
_TYPE = "214"
_COUNT = "220"
_FIRST = "221"
_OFFSET = "240"
_SCALE = "241"
_DTYPES = {"REAL64": "<f8", "REAL32": "<f4", "INT16": "<i2", "INT32": "<i4"}
_IMPLICIT = ("IMPLICIT", "IMPLIZIT")
_HEADER_BYTES = 4_000_000
Channel = Mapping[str, str]


def read_kuka_trace(
    path: Path, wanted: Wanted, mapping: TraceMapping, joint_names: Sequence[str]
) -> Trace:
    """The channels of a trace that are wanted; RecorderError where header and numbers disagree."""
    axes = _files_of_axes(path, len(joint_names))
    table = _table_of_axes([_table(each) for each in axes], axes) if axes else {}
    if not table:
        return table_trace(path, _table(path), wanted, mapping, joint_names)
    trace = table_trace(path, table, wanted, mapping, joint_names)
    said = f"{axes[0].name} .. {axes[-1].name} are joined, a file for each axis"
    return replace(trace, problems=(said, *trace.problems))


def _table(path: Path) -> dict[str, FloatArray]:
    """Numbers (N,) of all channels of a file, by names with units."""
    content = _content(path)
    if b"#BEGINCHANNELHEADER" not in content or len(content) > _HEADER_BYTES:
        raise RecorderError(f"{path}: is no header of a KUKA trace: it has no #BEGINCHANNELHEADER")
    channels = _channels(content.decode("latin-1"))
    table = {}
    for channel in channels:
        unit = channel.get(_UNIT, "").strip(" []")
        name = channel.get(_NAME, "").strip()
        heading = f"{name} [{unit}]" if unit else name
        if heading in table:
            raise RecorderError(f"{path}: channel {shown(heading)} is there twice")
        table[heading] = _values(path, channel, channels)
    lengths = {len(values) for values in table.values()}
    if len(lengths) > 1:
        raise RecorderError(f"{path}: its channels have different lengths: {sorted(lengths)}")
    return table


# Files of one axis each: their names differ in the number of the axis only.

_TIMES = ("time", "zeit", "t")
_POSITIONS = ("$axis_act", "axis_act", "axisact", "aipos", "position", "actual position", "pos_act")
_AXIS_OF = ("", *(f"{each}_" for each in _POSITIONS))
_NUMBERED = re.compile(r"\d+")


def _files_of_axes(path: Path, count: int) -> Sequence[Path]:
    """The files of all axes where `path` is that of one, else none."""
    beside = {each.name.lower(): each for each in path.parent.iterdir()}
    for found in reversed(list(_NUMBERED.finditer(path.stem))):
        before = path.stem[: found.start()]
        after = path.stem[found.end() :]
        numbers = [f"{k:0{len(found[0])}d}" for k in range(1, count + 1)]
        names = [f"{before}{number}{after}.dat".lower() for number in numbers]
        if path.name.lower() in names and all(name in beside for name in names):
            return [beside[name] for name in names]
    return ()


def _table_of_axes(
    tables: Sequence[Mapping[str, FloatArray]], paths: Sequence[Path]
) -> dict[str, FloatArray]:
    """One table of the files of all axes, as A1, A2, ..; empty where they hold no position of one
    axis each. RecorderError where their instants differ.
    """
    result: dict[str, FloatArray] = {}
    axes = range(1, len(paths) + 1)
    for axis, table, path in zip(axes, tables, paths, strict=True):
        plain = {name.partition("[")[0].strip().lower(): name for name in table}
        time = _first_of(_TIMES, plain)
        position = _first_of((*_POSITIONS, *(f"{each}a{axis}" for each in _AXIS_OF)), plain)
        of_others: set[str] = set()
        for other in axes:
            if other != axis:
                of_others |= {f"{each}a{other}" for each in _AXIS_OF}
        if not time or not position or of_others & set(plain):
            return {}
        first = result.setdefault(time, table[time])
        if len(first) != len(table[time]) or not np.allclose(first, table[time]):
            raise RecorderError(
                f"{path}: its instants are not those of {paths[0].name}: files of one axis each "
                "are joined where their times are the same"
            )
        unit = "".join(position.partition(" [")[1:])
        result[f"A{axis}{unit}"] = table[position]
    return result


def _first_of(names: Sequence[str], plain: Mapping[str, str]) -> str:
    """The heading of the first name that a table has; "": it has none of them."""
    for name in names:
        if name in plain:
            return plain[name]
    return ""


def _channels(text: str) -> Sequence[Channel]:
    found: list[dict[str, str]] = []
    inside = False
    for line in text.splitlines():
        if line.startswith("#"):
            inside = line.startswith("#BEGINCHANNELHEADER")
            if inside:
                found.append({})
        elif inside:
            number, _, value = line.partition(",")
            found[-1][number.strip()] = value.strip()
    return found


def _values(path: Path, channel: Channel, channels: Sequence[Channel]) -> FloatArray:
    """The numbers (N,) of a channel, in its unit: counted up, or read from its file, in which
    channels stand one after another or number by number in turn.
    """
    where = f"{path}: channel {shown(channel.get(_NAME, ''))}"
    count = int(_number(channel, _COUNT, where))
    if not 0 < count * len(channels) <= VALUES_MAX:
        raise RecorderError(f"{where} has {count} values, must be 1 to {VALUES_MAX} in all")
    offset = _number(channel, _OFFSET, where, 0.0)
    scale = _number(channel, _SCALE, where, 1.0)
    if channel.get(_KIND, "").upper() in _IMPLICIT:
        return np.asarray(offset + scale * np.arange(count, dtype=np.float64))
    kind = channel.get(_TYPE, "")
    if kind not in _DTYPES:
        known = ", ".join(_DTYPES)
        raise RecorderError(f"{where} is of type {shown(kind)}, known are {known}")
    file = _file_of_numbers(path, channel.get(_FILE, ""), where)
    raw = np.frombuffer(_content(file), np.uint8)
    size = np.dtype(_DTYPES[kind]).itemsize
    whole = len(raw) // size * size
    numbers = raw[:whole].view(_DTYPES[kind])
    first = int(_number(channel, _FIRST, where, 1.0)) - 1
    stride = 1
    if channel.get(_STORED, "").upper() == "BLOCK":
        stride = sum(each.get(_FILE) == channel.get(_FILE) for each in channels)
    last = first + (count - 1) * stride
    if first < 0 or last >= len(numbers):
        raise RecorderError(
            f"{where} ends at number {last + 1}, its file holds {len(numbers)}: was it cut?"
        )
    own = numbers[first : last + 1 : stride]
    return np.asarray(offset + scale * own.astype(np.float64))


def _number(channel: Channel, key: str, where: str, default: float = math.nan) -> float:
    text = channel.get(key, "")
    try:
        value = number_of(text) if text else default
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RecorderError(f"{where}: entry {key} is {shown(text)}, it must be a number")
    return value


def _file_of_numbers(path: Path, name: str, where: str) -> Path:
    """The file of the numbers: in the header's folder, in letters of any case."""
    plain = re.split(r"[\\/]", name)[-1].lower()
    for each in sorted(path.parent.iterdir()):
        if plain and each.name.lower() == plain:
            return each
    raise RecorderError(f"{where}: its file {shown(name)} is not beside the header")


def _content(path: Path) -> bytes:
    with os.fdopen(opened(path), "rb") as stream:
        return stream.read()
