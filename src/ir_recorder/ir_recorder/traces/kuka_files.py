"""Logs of KUKA controllers: packets of RSI as XML, and traces (a header `.dat` with its `.r64`).

RSI sends the axes in degrees (AIPos) and the time in ms (IPOC). A trace is a data set of DIAdem:
the header names every channel with its unit, and where its numbers stand in the binary file.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
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

_NAME, _UNIT, _KIND, _FILE, _STORED, _TYPE = "200", "202", "210", "211", "213", "214"
_COUNT, _FIRST, _OFFSET, _SCALE = "220", "221", "240", "241"
_DTYPES = {"REAL64": "<f8", "REAL32": "<f4", "INT16": "<i2", "INT32": "<i4"}
_IMPLICIT = ("IMPLICIT", "IMPLIZIT")
_HEADER_BYTES = 4_000_000
Channel = Mapping[str, str]


def read_kuka_trace(
    path: Path, wanted: Wanted, mapping: TraceMapping, joint_names: Sequence[str]
) -> Trace:
    """The channels of a trace that are wanted; RecorderError where header and numbers disagree."""
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
    return table_trace(path, table, wanted, mapping, joint_names)


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
    """The numbers (N,) of a channel, in its unit."""
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
    raw = np.frombuffer(_content(_beside(path, channel.get(_FILE, ""), where)), np.uint8)
    size = np.dtype(_DTYPES[kind]).itemsize
    numbers = raw[: len(raw) // size * size].view(_DTYPES[kind])
    first = int(_number(channel, _FIRST, where, 1.0)) - 1
    blocks = channel.get(_STORED, "").upper() == "BLOCK"
    stride = sum(each.get(_FILE) == channel.get(_FILE) for each in channels) if blocks else 1
    last = first + (count - 1) * stride
    if first < 0 or last >= len(numbers):
        raise RecorderError(
            f"{where} ends at number {last + 1}, its file holds {len(numbers)}: was it cut?"
        )
    return np.asarray(offset + scale * numbers[first : last + 1 : stride].astype(np.float64))


def _number(channel: Channel, key: str, where: str, default: float = math.nan) -> float:
    text = channel.get(key, "")
    try:
        value = number_of(text) if text else default
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RecorderError(f"{where}: entry {key} is {shown(text)}, it must be a number")
    return value


def _beside(path: Path, name: str, where: str) -> Path:
    """The file of the numbers: in the header's folder, in letters of any case."""
    plain = re.split(r"[\\/]", name)[-1].lower()
    for each in sorted(path.parent.iterdir()):
        if plain and each.name.lower() == plain:
            return each
    raise RecorderError(f"{where}: its file {shown(name)} is not beside the header")


def _content(path: Path) -> bytes:
    with os.fdopen(opened(path), "rb") as stream:
        return stream.read()
