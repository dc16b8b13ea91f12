"""Recordings from strangers: read in part or refused with a sentence, in bounded memory and time,
and nothing in them is taken for what it is not.
"""

from __future__ import annotations

import json
import resource
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.reading.mcap_file import RawRecording, read_raw
from ir_recorder.reading.reader import TYPES

MEMORY = 900 * 2**20  # bytes at the peak of a process that reads all: 250 MB are Python's modules
SECONDS = 20.0  # for one file, on a loaded machine; a second on an idle one
OTHER_TYPES = ("std_msgs/msg/String", "sensor_msgs/msg/JointState", "ir_msgs/msg/PowerState")

Files = dict[str, bytes]
Change = Callable[[str, str, str, bytes], tuple[str, str, bytes] | None]


def rewritten(
    raw: RawRecording,
    path: Path,
    change: Change = lambda topic, kind, text, data: (kind, text, data),
    encoding: Callable[[str], tuple[str, str]] = lambda topic: ("cdr", "ros2msg"),
    order: Callable[[int, int], int] = lambda time, number: time,
    compression: CompressionType = CompressionType.ZSTD,
) -> bytes:
    """The recording again, with other types, definitions, bytes, encodings or times."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=64_000)
        writer.start(profile="ros2", library="strange")
        for channel in raw.channels:
            message_encoding, schema_encoding = encoding(channel.topic)
            ids: dict[tuple[str, str], int] = {}
            for number, data in enumerate(channel.messages):
                found = change(channel.topic, channel.type, channel.schema_text, data)
                if found is None:
                    continue
                kind, text, content = found
                if (kind, text) not in ids:
                    schema = writer.register_schema(kind, schema_encoding, text.encode())
                    ids[kind, text] = writer.register_channel(
                        channel.topic, message_encoding, schema
                    )
                time = order(int(channel.log_time[number]), number)
                writer.add_message(ids[kind, text], time, content, time)
        for each in raw.attachments:
            writer.add_attachment(0, 0, each.name, each.media_type, each.data)
        writer.finish()
    return path.read_bytes()


def other_types(raw: RawRecording, path: Path) -> Iterator[tuple[str, bytes]]:
    """Every topic that is read, with a definition of another type: by its name, or under the
    name that the topic has.
    """
    library = SchemaLibrary()
    present = {channel.topic for channel in raw.channels if channel.messages}
    for name in TYPES:
        topic = name if name.startswith("/") else f"/{name}"
        if topic not in present:
            continue
        for other in OTHER_TYPES:
            if other == TYPES[name]:
                continue
            text = library.schema(other).text

            def by_name(
                place: str, kind: str, own: str, data: bytes, topic: str = topic,
                other: str = other, text: str = text,
            ) -> tuple[str, str, bytes]:  # fmt: skip
                return (other, text, data) if place == topic else (kind, own, data)

            def in_disguise(
                place: str, kind: str, own: str, data: bytes, topic: str = topic, text: str = text
            ) -> tuple[str, str, bytes]:
                return (kind, text, data) if place == topic else (kind, own, data)

            yield f"{name} is {other}", rewritten(raw, path, by_name)
            yield f"{name} is defined as {other}", rewritten(raw, path, in_disguise)


def damaged(raw: RawRecording, path: Path) -> Iterator[tuple[str, bytes]]:
    """Encodings, orders, sizes and ends of other files."""
    whole = rewritten(raw, path)
    yield "empty", b""
    yield "only the magic", whole[:8]
    yield "text", b"not a recording\n" * 100
    for part in (0.01, 0.1, 0.5, 0.9, 0.999):
        yield f"cut at {part}", whole[: int(part * len(whole))]
    for at in np.linspace(9, len(whole) - 1, 8).astype(int):
        yield f"a byte at {at} is another", whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :]
    for message, schema in (("json", "jsonschema"), ("protobuf", "protobuf"), ("cdr", "ros2idl")):
        yield (
            f"{message} by {schema}",
            rewritten(raw, path, encoding=lambda topic, m=message, s=schema: (m, s)),
        )
    yield "times run back", rewritten(raw, path, order=lambda time, number: 10**15 - number)
    yield "all at once", rewritten(raw, path, order=lambda time, number: 1)
    yield "lz4", rewritten(raw, path, compression=CompressionType.LZ4)
    yield "not compressed", rewritten(raw, path, compression=CompressionType.NONE)
    yield "empty messages", rewritten(raw, path, lambda t, k, x, d: (k, x, b""))
    yield "short messages", rewritten(raw, path, lambda t, k, x, d: (k, x, d[:9]))
    yield "long messages", rewritten(raw, path, lambda t, k, x, d: (k, x, d + b"\0" * 999))
    yield "big endian", rewritten(raw, path, lambda t, k, x, d: (k, x, b"\0\0" + d[2:]))
    yield "ones", rewritten(raw, path, lambda t, k, x, d: (k, x, d[:4] + b"\xff" * len(d[4:])))
    yield "no definitions", rewritten(raw, path, lambda t, k, x, d: (k, "", d))
    yield "no types", rewritten(raw, path, lambda t, k, x, d: ("", x, d))
    yield "no messages", rewritten(raw, path, lambda t, k, x, d: None)


def record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def mcap(*records: bytes) -> bytes:
    magic = b"\x89MCAP0\r\n"
    end = record(0x0F, struct.pack("<I", 0)) + record(0x02, struct.pack("<QQI", 0, 0, 0))
    return magic + record(0x01, text(b"ros2") + text(b"")) + b"".join(records) + end + magic


def chunk(data: bytes, compression: bytes, packed: bytes, claimed: int | None = None) -> bytes:
    size = len(data) if claimed is None else claimed
    head = struct.pack("<QQQI", 0, 1, size, zlib.crc32(data))
    return record(0x06, head + text(compression) + struct.pack("<Q", len(packed)) + packed)


def channel(number: int, pairs: int) -> bytes:
    """A channel with a map of that many short texts."""
    pair = b"".join(text(b"%x" % k) + text(b"") for k in range(pairs))
    return record(0x04, struct.pack("<HH", number, 0) + text(b"/t") + text(b"cdr") + text(pair))


def bombs(chunks: int) -> Iterator[tuple[str, bytes]]:
    """Files of some kB to MB that claim or hold much more; chunks: of 60 MB that lz4 packs, each of
    which is looked through.
    """
    import lz4.frame
    import zstandard

    pack = zstandard.ZstdCompressor().compress
    for name, data in (
        ("channels with maps", channel(1, 30_000) * 60),
        ("one channel with a map of 4 MB", channel(1, 400_000)),
        ("sixty thousand channels", b"".join(channel(k, 0) for k in range(60_000))),
        ("the smallest messages", record(0x05, struct.pack("<HIQQ", 1, 0, 0, 0)) * 600_000),
        ("nothing", b"\0" * 60_000_000),
    ):
        yield f"zstd, twenty times: {name}", mcap(*[chunk(data, b"zstd", pack(data))] * 20)
    data = b"\0" * 60_000_000
    yield "lz4: nothing", mcap(*[chunk(data, b"lz4", lz4.frame.compress(data))] * chunks)
    yield "claims 2**62 bytes", mcap(chunk(data, b"zstd", pack(data), 2**62))
    yield "claims less than it holds", mcap(chunk(data, b"zstd", pack(data), 100))
    yield "unknown compression", mcap(chunk(data[:100], b"brotli", data[:100]))
    yield "a record of 2**63 bytes", mcap()[:-40] + struct.pack("<BQ", 5, 2**63)
    pairs = b"".join(text(b"%x" % k) + text(b"") for k in range(300_000))
    yield "facts of 3 MB", mcap(record(0x0C, text(b"facts") + text(pairs)))
    yield "facts, 200 times", mcap(*[record(0x0C, text(b"f") + text(pairs[:90_000]))] * 200)
    yield "message indexes", mcap(record(0x07, struct.pack("<H", 1) + text(b"\0" * 48_000_000)))
    yield "statistics", mcap(record(0x0B, struct.pack("<QHIIIIQQ", *[0] * 8) + text(pairs[:6])))


READ = """
import json, sys, time, traceback
from ir_recorder import RecorderError, analyse, findings, read_recording
from ir_recorder.report import report_html
for path in sys.argv[1:]:
    begun = time.process_time()
    said, other = [], ""
    try:
        recording = read_recording(path)
        said = list(recording.problems)
        analysis = analyse(recording)
        page = report_html(analysis, findings(analysis))
        said += list(analysis.problems)
    except RecorderError as error:
        said.append(str(error))
    except BaseException:
        other = traceback.format_exc()
    status = open("/proc/self/status").read()  # ru_maxrss would hold that of the parent process
    peak = int(status.partition("VmHWM:")[2].split()[0]) * 1024
    print(json.dumps([path, said, other, time.process_time() - begun, peak]), flush=True)
"""


def judged(
    files: Iterator[tuple[str, bytes]], folder: Path
) -> dict[str, tuple[list[str], str, float, int]]:
    """What a process of its own says of each: sentences, a traceback, seconds, peak memory."""
    paths = {}
    for number, (name, content) in enumerate(files):
        path = folder / f"{number:03d}.mcap"
        path.write_bytes(content)
        paths[str(path)] = name
    ran = subprocess.run(
        [sys.executable, "-c", READ, *paths], capture_output=True, text=True, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (6 * 2**30, 6 * 2**30)),
    )  # fmt: skip
    lines = [json.loads(line) for line in ran.stdout.splitlines() if line.startswith("[")]
    assert len(lines) == len(paths), ran.stderr[-2000:]
    return {paths[path]: (said, other, taken, peak) for path, said, other, taken, peak in lines}


def contents_of(path: Path) -> object:
    """All that a file holds, without how it was written."""
    raw = read_raw(path)
    channels = {(c.topic, c.type, c.schema_text, c.messages) for c in raw.channels if c.messages}
    return channels, {(each.name, each.data) for each in raw.attachments}


@pytest.mark.long
@pytest.mark.parametrize("chunks", [2, pytest.param(20, marks=pytest.mark.long)])
def test_bombs_stay_within_memory_and_time(chunks: int, tmp_path: Path) -> None:
    found = judged(bombs(chunks), tmp_path)
    assert {name: other for name, (_, other, _, _) in found.items() if other} == {}
    assert [name for name, (said, _, _, _) in found.items() if not said] == []
    assert max(peak for _, _, _, peak in found.values()) < MEMORY
    assert max(taken for _, _, taken, _ in found.values()) < SECONDS


def test_damaged_files_are_read_in_part_or_refused(demo_file: Path, tmp_path: Path) -> None:
    files = dict(damaged(read_raw(demo_file), tmp_path / "x"))
    found = judged(iter(files.items()), tmp_path)
    assert {name: other for name, (_, other, _, _) in found.items() if other} == {}
    whole = {"lz4", "not compressed", "times run back", "all at once", "long messages"}
    silent = {name for name, (said, _, _, _) in found.items() if not said} - whole
    assert {name for name in silent if not name.startswith("a byte at")} == set()
    for name in silent:  # in the indexes, which aren't read: nothing else may differ
        (tmp_path / "x").write_bytes(files[name])
        assert contents_of(tmp_path / "x") == contents_of(demo_file), name
    assert max(taken for _, _, taken, _ in found.values()) < SECONDS


@pytest.mark.long
def test_a_topic_of_another_type_is_named(short_file: Path, tmp_path: Path) -> None:
    found = judged(other_types(read_raw(short_file), tmp_path / "x"), tmp_path)
    assert len(found) >= 36
    assert {name: other for name, (_, other, _, _) in found.items() if other} == {}
    unnamed = []
    for name, (said, _, _, _) in found.items():
        topic = name.split(" ")[0].lstrip("/")
        if not any(topic in sentence for sentence in said):
            unnamed.append(name)
    assert unnamed == []
