"""Recordings from strangers: a small file takes no more memory than it may, and reading it ends."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.records import Chunk
from mcap.writer import CompressionType, Writer

from ir_recorder.errors import ReadError
from ir_recorder.format.schemas import MOST_DEPTH, MOST_TEXT, MOST_TYPES, definitions_of
from ir_recorder.reading.chunk_limits import MOST_RECORDS, ChunkReader, ReadLimits
from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.reading.reader import read_recording

MIB = 2**20


def bomb(
    path: Path, chunks: int, size: int, compression: CompressionType = CompressionType.ZSTD
) -> Path:
    """A file of chunks that hold one message of zeros each, `size` bytes uncompressed."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=size, compression=compression)
        writer.start("ros2", "stranger")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/text", "cdr", schema)
        for k in range(chunks):
            writer.add_message(channel, k, bytes(size), k)
        writer.finish()
    return path


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_beyond_its_bound_costs_only_itself(
    tmp_path: Path, compression: CompressionType
) -> None:
    path = bomb(tmp_path / "a.mcap", 1, 80 * MIB, compression)
    assert path.stat().st_size < MIB
    tracemalloc.start()
    with pytest.raises(ReadError, match=r"claims 80 MiB uncompressed, at most 64 MiB are read"):
        read_raw(path)
    assert tracemalloc.get_traced_memory()[1] < 8 * MIB
    tracemalloc.stop()


def test_many_chunks_end_at_the_bound_of_the_whole(tmp_path: Path) -> None:
    path = bomb(tmp_path / "a.mcap", 10, MIB)
    raw = read_raw(path, limits=ReadLimits(total=4 * MIB))
    assert any(
        "more than 4 MiB uncompressed: the rest is left out" in problem for problem in raw.problems
    )
    channel = raw.channel("/text")
    assert channel is not None
    assert len(channel.messages) == 3


def test_messages_of_no_bytes_take_memory_too(tmp_path: Path) -> None:
    """Ten thousand of them are 0.3 MB, and as objects four times as much."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start("ros2", "stranger")
        channel = writer.register_channel("/text", "cdr", 0)
        for k in range(10_000):
            writer.add_message(channel, k, b"", k)
        writer.finish()
    with pytest.raises(ReadError, match="more than 1 MiB uncompressed: the rest is left out"):
        read_raw(path, limits=ReadLimits(total=MIB))


def test_attachments_count_too(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "stranger")
        writer.add_attachment(0, 0, "cell.yaml", "text/plain", bytes(2 * MIB))
        writer.finish()
    with pytest.raises(ReadError, match="more than 1 MiB uncompressed: the rest is left out"):
        read_raw(path, limits=ReadLimits(total=MIB))


def test_what_a_small_file_claims_is_bounded_before_it_is_decompressed(tmp_path: Path) -> None:
    """Chunks within their own bound: at most `free` and `ratio` times the file are opened."""
    path = bomb(tmp_path / "a.mcap", 10, MIB)
    raw = read_raw(path, limits=ReadLimits(free=2 * MIB, ratio=10))
    assert any("10 times as much as compressed are read" in problem for problem in raw.problems)
    channel = raw.channel("/text")
    assert channel is not None
    assert 0 < len(channel.messages) < 10


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_holds_more_than_it_claims_is_not_opened(compression: str) -> None:
    pack = zstandard.compress if compression == "zstd" else lz4.frame.compress
    chunk = Chunk(compression, pack(bytes(300 * MIB)), 0, 0, 0, 100)
    tracemalloc.start()
    with pytest.raises(ReadError, match="claims 100 bytes"):
        ChunkReader(ReadLimits()).records(chunk)
    assert tracemalloc.get_traced_memory()[1] < 40 * MIB
    tracemalloc.stop()


def test_an_unknown_compression_is_named() -> None:
    with pytest.raises(ReadError, match="known are zstd, lz4"):
        ChunkReader(ReadLimits()).records(Chunk("brotli", b"", 0, 0, 0, 0))


def nested(depth: int) -> str:
    inner = [f"{'=' * 80}\nMSG: p/T{k}\np/T{k + 1}[9] next\n" for k in range(1, depth)]
    return "p/T1[9] next\n" + "".join(inner) + f"{'=' * 80}\nMSG: p/T{depth}\nint8 x\n"


@pytest.mark.parametrize(
    ("schema", "sentence"),
    [
        ("p/T next\n", "contains itself"),
        (f"p/U next\n{'=' * 80}\nMSG: p/U\np/T[] next\n", "contains itself"),
        (nested(MOST_DEPTH + 2).replace("[9]", ""), "built deeper than"),
        (nested(9), "more than 100000 fields"),
        ("string[4000000000] x\n", "more than 100000 fields"),
        ("int8[0] x\n", "no elements"),
        (f"int8[{'9' * 5000}] x\n", "whose length has 5,000 digits"),
        (nested(MOST_TYPES + 1).replace("[9]", "[]"), "more than 1,000 types"),
        (f"int8 x\n#{' ' * MOST_TEXT}", "at most 524,288 are read"),
    ],
)
def test_a_definition_without_an_end_is_a_sentence(
    schema: str, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(ReadError, match=sentence):
        definitions_of("p/msg/T", schema)
    for topic in ("/joint_states", "/ir_program_runner/program_state"):
        path = tmp_path / f"{topic.count('/')}.mcap"
        with path.open("wb") as stream:
            writer = Writer(stream)
            writer.start("ros2", "stranger")
            number = writer.register_schema("p/msg/T", "ros2msg", schema.encode())
            channel = writer.register_channel(topic, "cdr", number)
            writer.add_message(channel, 1, b"\0\1\0\0" + bytes(64), 1)
            writer.finish()
        assert any(topic in problem for problem in read_recording(path).problems)


def test_a_chunk_of_very_many_records_is_not_opened() -> None:
    """Sixty megabytes of zeros compress to a few kilobytes, and are millions of empty records."""
    data = bytes(9 * (MOST_RECORDS + 1))
    with pytest.raises(ReadError, match="more than 500,000 records"):
        ChunkReader(ReadLimits()).records(Chunk("", data, 0, 0, 0, len(data)))


def test_records_that_cost_nothing_in_the_file_end_at_a_bound(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("ir_recorder.reading.chunk_limits.MOST_CHEAP", 10_000)
    data = (b"\x05" + (22).to_bytes(8, "little") + bytes(22)) * 6_000
    small = zstandard.compress(data)
    assert len(small) < 1_000
    chunk = Chunk("zstd", small, 0, 0, 0, len(data))
    reader = ChunkReader(ReadLimits())
    assert len(reader.records(chunk)) == 6_000
    with pytest.raises(ReadError, match="more than its compressed chunks have bytes"):
        reader.records(chunk)
