"""Bags and tables as strangers might write them, each with what it says, and the judge of what was
read.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ir_recorder.traces import read_traces

NAMES = tuple(f"joint_a{k}" for k in range(1, 7))
COUNT = 200
STEP = 0.004  # s
BEGIN = 1_700_000_000 * 10**9  # ns
NEAR = 1e-6  # rad


def motion(rng: np.random.Generator) -> np.ndarray:
    """Positions (COUNT, 6) [rad] around KUKA's home: no two rows are alike."""
    share = np.linspace(0.0, 1.0, COUNT)[:, None]
    home = np.radians([0.0, -90.0, 90.0, 0.0, 30.0, 0.0])
    return home + share * rng.uniform(0.2, 0.5, 6)


def joint_state(
    names: tuple[str, ...], position: np.ndarray, stamp: int, *, kind: int = 1
) -> bytes:
    """A message in CDR. kind: 1 little-endian."""
    out = bytearray(struct.pack("<ii", stamp // 10**9, stamp % 10**9))

    def align(size: int) -> None:
        out.extend(b"\0" * (-len(out) % size))

    def text(value: str) -> None:
        align(4)
        out.extend(struct.pack("<I", len(value) + 1) + value.encode() + b"\0")

    text("")
    align(4)
    out.extend(struct.pack("<I", len(names)))
    for name in names:
        text(name)
    for values in (position, (), ()):
        align(4)
        out.extend(struct.pack("<I", len(values)))
        if len(values):
            align(8)
            out.extend(struct.pack(f"<{len(values)}d", *values))
    return bytes([0, kind, 0, 0]) + bytes(out)


def bag(
    path: Path, rows: list[tuple[int, bytes]], kind: str = "sensor_msgs/msg/JointState"
) -> None:
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
        file.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
            "data BLOB)"
        )
        file.execute("INSERT INTO topics VALUES (1, '/joint_states', ?)", (kind,))
        query = "INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)"
        file.executemany(query, rows)


def bags(rng: np.random.Generator, folder: Path) -> Iterator[tuple[str, Path, np.ndarray, bool]]:
    """Name, file, positions (COUNT, 6) at the steps, and whether it may be read."""
    q = motion(rng)
    stamps = [BEGIN + int(k * STEP * 1e9) for k in range(COUNT)]
    whole = [(t, joint_state(NAMES, row, t)) for t, row in zip(stamps, q, strict=True)]
    shuffled = [whole[k] for k in rng.permutation(COUNT)]
    finger = [(t + 1, joint_state(("finger",), np.array([0.01]), t + 1)) for t in stamps]
    nobody = [(t + 1, joint_state((), np.zeros(0), t + 1)) for t in stamps[::7]]
    turned = [(t, joint_state(NAMES[::-1], row[::-1], t)) for t, row in zip(stamps, q, strict=True)]
    names = (*NAMES[:5], "joint_b1")
    others = [(t, joint_state(names, row, t)) for t, row in zip(stamps, q, strict=True)]
    files = {
        "plain": (whole, True),
        "shuffled": (shuffled, True),
        "a gripper between": (sorted(whole + finger), True),
        "states of nobody": (sorted(whole + nobody), True),
        "joints in another order": (turned, True),
        "empty messages": ([*whole[:50], (stamps[50] + 1, b""), *whole[50:]], True),
        "foreign bytes": ([*whole[:50], (stamps[50] + 1, b"\0\1\0\0\xff\xff"), *whole[50:]], True),
        "every message twice": (sorted(whole + whole), True),
        "order changes in the middle": (whole[:90] + turned[90:], True),
        "other joints in the middle": (whole[:90] + others[90:], False),
        "big-endian": (
            [(t, joint_state(NAMES, r, t, kind=0)) for t, r in zip(stamps, q, strict=True)],
            False,
        ),
        "no rows": ([], False),
    }
    for name, (rows, readable) in files.items():
        path = folder / f"{name.replace(' ', '_')}.db3"
        bag(path, rows)
        yield name, path, q, readable
    other = folder / "another_type.db3"
    bag(other, whole, "std_msgs/msg/String")
    yield "another type", other, q, False
    cut = folder / "cut.db3"
    cut.write_bytes((folder / "plain.db3").read_bytes()[:6000])
    yield "cut", cut, q, False
    no_bag = folder / "no_bag.db3"
    no_bag.write_bytes(b"time,joint_a1\n0,0\n")
    yield "no bag", no_bag, q, False


def _table(headings: list[str], rows: np.ndarray, sign: str = ",", point: str = ".") -> str:
    lines = [sign.join(headings)] if headings else []
    cells = [[f"{value:.9g}".replace(".", point) for value in row] for row in rows]
    lines += [sign.join(row) for row in cells]
    return "\n".join([*lines, ""])


def tables(rng: np.random.Generator, folder: Path) -> Iterator[tuple[str, Path, np.ndarray, bool]]:
    """Name, file, positions (COUNT, 6) at the steps, and whether it may be read."""
    q = motion(rng)
    time = STEP * np.arange(COUNT)
    rows = np.column_stack([time, q])
    degrees = np.column_stack([time, np.degrees(q)])
    kuka = [f"A{k}" for k in range(1, 7)]
    plain = _table(["time", *NAMES], rows)
    late = rows.copy()
    late[100:, 0] += 0.005
    back = rows.copy()
    back[100, 0] = back[90, 0]
    files: dict[str, tuple[str, bool]] = {
        "plain": (plain, True),
        "semicolons and commas": (_table(["time", *NAMES], rows, ";", ","), True),
        "degrees and ms": (
            _table(["time [ms]", *(f"{n} (deg)" for n in NAMES)], degrees * [1e3, *6 * [1]]),
            True,
        ),
        "KUKA names": (_table(["time", *kuka], degrees), True),
        "RTDE": (_table(["timestamp", *(f"actual_q_{k}" for k in range(6))], rows), True),
        "a cut last line": (plain[:-30], True),
        "rows that repeat": (plain + plain.splitlines()[-1] + "\n", True),
        "KUKA names in rad": (_table(["time", *kuka], rows), False),
        "no headings": (_table([], rows), False),
        "no time": (_table(list(NAMES), q), False),
        "a time that goes back": (_table(["time", *NAMES], back), False),
        "an underscore": (plain.replace("0.004,", "0.0_04,", 1), False),
        "a word": (plain.replace("0.008,", "soon,", 1), False),
        "a column twice": (plain.replace("joint_a2", "joint_a1", 1), False),
        "a joint too many": (plain.replace("joint_a6", "joint_a7", 1), False),
        "a row too short": (plain.replace(",", "", 13), False),
    }
    for name, (text, readable) in files.items():
        path = folder / f"{name.replace(' ', '_')}.csv"
        path.write_text(text)
        yield name, path, q, readable


def _egm(number: int, joints: np.ndarray) -> bytes:
    """A message of ABB's EGM: header (number, ms, data) and the joints in degrees."""
    ms = round(1e3 * STEP * number)
    header = b"".join(bytes([tag]) + _varint(v) for tag, v in ((8, number), (16, ms), (24, 2)))
    values = b"".join(b"\x09" + struct.pack("<d", each) for each in np.degrees(joints))
    feedback = b"\x0a" + _varint(len(values)) + values
    return b"\x0a" + _varint(len(header)) + header + b"\x12" + _varint(len(feedback)) + feedback


def _varint(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def messages(
    rng: np.random.Generator, folder: Path
) -> Iterator[tuple[str, Path, np.ndarray, bool]]:
    """Logs of EGM: name, file, positions (COUNT, 6) at the steps, and whether it may be read."""
    q = motion(rng)
    whole = [_egm(k, row) for k, row in enumerate(q)]
    counted = [_varint(len(each)) + each for each in whole]
    near = np.argsort(np.arange(COUNT) + rng.uniform(0.0, 5.0, COUNT))
    files = {
        "datagrams": (b"".join(whole), True),
        "lengths before them": (b"".join(counted), True),
        "some overtake others": (b"".join(counted[k] for k in near), True),
        "shuffled": (b"".join(counted[k] for k in rng.permutation(COUNT)), False),
        "two sessions": (b"".join(counted + counted[::2]), False),
        "cut": (b"".join(counted)[:-9], True),
        "some are gone": (b"".join(counted[:50] + counted[60:]), True),
        "seven joints": (b"".join(_egm(k, np.append(row, 0)) for k, row in enumerate(q)), False),
        "a joint of nan": (b"".join([*whole[:9], _egm(9, np.append(q[9, :5], np.nan))]), False),
        "text": (b"time,j1\n0,0\n" * COUNT, False),
        "noise": (rng.bytes(4000), False),
    }
    for name, (content, readable) in files.items():
        path = folder / f"{name.replace(' ', '_')}.egm"
        path.write_bytes(content)
        yield name, path, q, readable


def misread_log(path: Path, q: np.ndarray) -> str:
    """What was read otherwise, "" where nothing was. Raises RecorderError."""
    (trace,) = read_traces(path, None, NAMES)
    found = trace.joints(NAMES)
    if found is None:
        return "no positions"
    rows = np.rint((trace.time - trace.time[0]) / STEP).astype(int)
    known = (rows >= 0) & (rows < COUNT)
    if not known.all() or np.abs(found - q[rows]).max() > NEAR:
        return "rows hold other positions than the file at their times"
    if len(rows) < COUNT and not trace.problems:
        return f"{COUNT - len(rows)} rows are gone without a word"
    return ""
