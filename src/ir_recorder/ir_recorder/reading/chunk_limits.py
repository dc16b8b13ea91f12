"""Chunks of a recording opened within bounds: a small file may claim, or hold, gigabytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from io import BytesIO

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Metadata, Schema
from mcap.stream_reader import breakup_chunk

from ir_recorder.errors import ReadError

_STEP = 1 << 20  # bytes that are decompressed at a time
_HEAD = 9  # bytes of a record's kind and length
MOST_RECORDS = 500_000  # in one chunk; one of 4 MB of the smallest messages has 100,000
MOST_CHEAP = 100_000  # records of a recording beyond one for each byte of its compressed chunks
MOST_CHANNELS = 10_000  # of a recording, and as many schemas; a cell has 50
MOST_RECORD = 1 << 20  # bytes of a record but chunks, messages and attachments; a schema has 20 kB
MOST_CHANNEL = 1 << 16  # bytes of a channel; one of this project has 500
_OVERHEAD = 120  # bytes of memory that a message takes beside its own
_MAP_FACTOR = 30  # bytes of memory for a byte of a record that holds maps of short texts


@dataclass(frozen=True)
class ReadLimits:
    """Most bytes of memory for one chunk and for a whole recording.

    chunk: writers close chunks at 0.25 to 4 MB, a single large message may exceed that. total: five
    hours of a cell. free, ratio: beyond `free` bytes a recording may be `ratio` times as large as
    in its file, as time to decompress is spent on what a file holds; a robot that rests all day
    compresses to a fiftieth.
    """

    chunk: int = 64 * 2**20
    total: int = 2 * 2**30
    free: int = 128 * 2**20
    ratio: int = 400


class ChunkReader:
    """Opens chunks one after another; ReadError for one that is too large, or once all are."""

    def __init__(self, limits: ReadLimits) -> None:
        self._limits = limits
        self._used = 0
        self._given = 0
        self._claimed = 0
        self._channels = 0
        self._cheap = 0

    def records(self, chunk: Chunk) -> list[McapRecord]:
        """What is in the chunk; its check sum is compared. Raises ReadError for a damaged one and
        for one beyond the bounds.
        """
        if chunk.uncompressed_size > self._limits.chunk:
            claimed = _mib(chunk.uncompressed_size)
            most = _mib(self._limits.chunk)
            raise ReadError(f"it claims {claimed} uncompressed, at most {most} are read")
        self._given += len(chunk.data)
        self._claimed += chunk.uncompressed_size
        free = self._limits.free
        times = self._limits.ratio
        if self._claimed > free + times * self._given:
            raise TooLargeError(
                f"{_mib(self._claimed)} uncompressed from {_mib(self._given)}: at most "
                f"{_mib(free)} and "
                f"{times} times as much as compressed are read, the rest is left out"
            )
        data = _decompressed(chunk)
        self.count(len(data))
        self._cheap += max(0, _number_of_records(data) - len(chunk.data))
        if self._cheap > MOST_CHEAP:
            raise TooLargeError(
                f"{MOST_CHEAP:,} records more than its compressed chunks have bytes: the rest is "
                "left out"
            )
        records = breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)
        self.count(_OVERHEAD * len(records))
        for record in records:
            self.describe(record)
        return records

    def describe(self, record: McapRecord) -> None:
        """Counts what isn't a message: schemas, channels, and facts with their maps of texts.
        Raises TooLargeError beyond their bounds.
        """
        if isinstance(record, Channel):
            self._channels += 1
            size = sum(len(key) + len(value) for key, value in record.metadata.items())
            self.count(_MAP_FACTOR * (size + len(record.topic) + 8 * len(record.metadata)))
        elif isinstance(record, Schema):
            self._channels += 1
            self.count(2 * len(record.data))
        elif isinstance(record, Metadata):
            size = sum(len(key) + len(value) for key, value in record.metadata.items())
            self.count(_MAP_FACTOR * (size + 8 * len(record.metadata)))
        if self._channels > 2 * MOST_CHANNELS:
            raise TooLargeError(
                f"more than {MOST_CHANNELS:,} channels and their schemas: the rest is left out"
            )

    def count(self, size: int) -> None:
        """Adds to the memory in use. Raises TooLargeError beyond its bound."""
        self._used += size
        if self._used > self._limits.total:
            raise TooLargeError(
                f"more than {_mib(self._limits.total)} uncompressed: the rest is left out"
            )


class TooLargeError(ReadError):
    """The recording as a whole exceeds its bound; what was read so far stays."""


def most_of(kind: int) -> int:
    """Bytes that a record may have which is no chunk, message or attachment."""
    return MOST_CHANNEL if kind == Opcode.CHANNEL else MOST_RECORD


def _number_of_records(data: bytes) -> int:
    """How many there are; ReadError for a chunk of so many that making them takes minutes and
    gigabytes, or with a record of maps and texts that is too long.
    """
    at = 0
    for number in range(MOST_RECORDS):
        if at + _HEAD > len(data):
            return number
        length = int.from_bytes(data[at + 1 : at + _HEAD], "little")
        if data[at] != Opcode.MESSAGE and length > most_of(data[at]):
            raise ReadError(f"it has a record of {length:,} bytes that is no message")
        at += _HEAD + length
    raise ReadError(f"it has more than {MOST_RECORDS:,} records")


def _decompressed(chunk: Chunk) -> bytes:
    """The chunk's bytes, never more than it claims and one."""
    wanted = chunk.uncompressed_size
    if chunk.compression == "zstd":
        data = _read_at_most(
            zstandard.ZstdDecompressor().stream_reader(chunk.data).read, wanted + 1
        )
    elif chunk.compression == "lz4":
        with lz4.frame.open(BytesIO(chunk.data)) as stream:
            data = _read_at_most(stream.read, wanted + 1)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise ReadError(f"compression {chunk.compression[:20]!r} is unknown: known are zstd, lz4")
    if len(data) != wanted:
        raise ReadError(f"it claims {wanted} bytes uncompressed and has others")
    return data


def _read_at_most(read: Callable[[int], bytes], most: int) -> bytes:
    parts = []
    size = 0
    while size < most and (part := read(min(_STEP, most - size))):
        parts.append(part)
        size += len(part)
    return b"".join(parts)


def _mib(size: int) -> str:
    return f"{size / 2**20:,.0f} MiB"
