"""MCAP files channel by channel, damaged ones too; several files of a recording as one."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.exceptions import EndOfFile, InvalidMagic
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Footer, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from ir_msgs_py import names
from ir_recorder.errors import ReadError
from ir_recorder.format import contents
from ir_recorder.format.contents import part_path, repeated_messages
from ir_recorder.reading.chunk_limits import ChunkReader, ReadLimits, TooLargeError, most_of
from ir_values.arrays import IntArray
from ir_values.errors import FileRefusedError, one_line
from ir_values.files import ANYWHERE, FileRoots

# A recording as bytes by topic, with its attachments and facts.


@dataclass(frozen=True)
class RawChannel:
    """One topic's messages as bytes; log_time (N,) [ns] does not decrease."""

    topic: str
    type: str
    message_encoding: str
    schema_encoding: str
    schema_text: str
    qos: str
    log_time: IntArray
    messages: tuple[bytes, ...]


@dataclass(frozen=True)
class RawAttachment:
    """A file beside the messages."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True)
class RawRecording:
    """Everything readable in a file; `problems` says what wasn't, `facts` are the metadata records'
    texts by key.
    """

    path: Path
    channels: tuple[RawChannel, ...]
    attachments: tuple[RawAttachment, ...]
    facts: tuple[tuple[str, str], ...]
    problems: tuple[str, ...]

    def channel(self, topic: str) -> RawChannel | None:
        """The first channel of a topic that has messages."""
        return next((c for c in self.channels if c.topic == topic and c.messages), None)

    def attachment(self, name: str) -> bytes | None:
        """Content of the last attachment of that name."""
        return next((a.data for a in reversed(self.attachments) if a.name == name), None)

    def fact(self, key: str) -> str:
        """A fact of the metadata records, "" where it is missing."""
        return next((value for name, value in reversed(self.facts) if name == key), "")


# A recording in several files read as one: what a further file repeats is left out.

MOST_PARTS = 10_000


def with_further_parts(first: RawRecording, read: Callable[[Path], RawRecording]) -> RawRecording:
    """The recording with the further files beside its first one; any other file as it is.

    read: reads one file. A file that is missing or can't be read becomes a problem.
    """
    if first.fact(contents.PART) != "0":
        return first
    parts = [first]
    problems = list(first.problems)
    for number in range(1, MOST_PARTS):
        path = part_path(first.path, number)
        if not path.exists():
            if not part_path(first.path, number + 1).exists():
                break
            problems.append(f"{path.name} is missing: what it held is not read")
            continue
        try:
            part = read(path)
        except ReadError as error:
            problems.append(str(error))
            continue
        if part.fact(contents.RECORDING) == first.fact(contents.RECORDING):
            parts.append(_without_repeated(part))
            problems += [f"{path.name}: {problem}" for problem in part.problems]
    return replace(
        first,
        channels=_one_per_topic([channel for part in parts for channel in part.channels]),
        attachments=tuple(attachment for part in parts for attachment in part.attachments),
        facts=tuple(dict.fromkeys(fact for part in parts for fact in part.facts)),
        problems=tuple(problems),
    )


def _without_repeated(part: RawRecording) -> RawRecording:
    repeated = repeated_messages(part.fact(contents.REPEATED))
    channels = []
    for channel in part.channels:
        count = repeated.get(channel.topic, 0)
        channels.append(
            replace(channel, log_time=channel.log_time[count:], messages=channel.messages[count:])
        )
    return replace(part, channels=tuple(channels))


def _one_per_topic(channels: list[RawChannel]) -> tuple[RawChannel, ...]:
    """One channel for those of a topic and a type, in the order of the files."""
    groups: dict[tuple[str, str, str], list[RawChannel]] = {}
    for channel in channels:
        groups.setdefault((channel.topic, channel.type, channel.message_encoding), []).append(
            channel
        )
    return tuple(
        replace(
            group[0],
            log_time=np.concatenate([channel.log_time for channel in group]),
            messages=tuple(message for channel in group for message in channel.messages),
        )
        for group in groups.values()
    )


# What an MCAP file holds, channel by channel, however much of it is left.
#
# A recording that ended with a power cut has no summary and half a chunk; one that was copied badly
# has a chunk whose check sum fails. All that can be read is given, with a sentence for what can't.

LATEST = 2**63 - 1  # ns: the last time that an int64 holds


_CHECK_SUM = 4  # bytes
MOST_FACTS = 10_000  # a recording of the cell has 20
_HEAD = 9  # bytes of a record's kind and length
_INDEXES = frozenset(
    (
        Opcode.MESSAGE_INDEX,
        Opcode.CHUNK_INDEX,
        Opcode.ATTACHMENT_INDEX,
        Opcode.METADATA_INDEX,
        Opcode.STATISTICS,
        Opcode.SUMMARY_OFFSET,
    )
)
_LARGE = frozenset((Opcode.CHUNK, Opcode.MESSAGE, Opcode.ATTACHMENT))


class _Collector:
    """Sorts records into channels; those of a lost chunk are missed by number only."""

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.times: dict[int, list[int]] = {}
        self.data: dict[int, list[bytes]] = {}
        self.sequence: dict[int, list[int]] = {}
        self.attachments: list[RawAttachment] = []
        self.facts: list[tuple[str, str]] = []
        self.problems: list[str] = []
        self.orphans = 0
        self.facts_left_out = 0
        self.timeless = 0
        self.complete = False

    def add(self, record: McapRecord) -> None:
        """Keep a record by its kind; count messages of unknown channels and impossible times."""
        if isinstance(record, Message):
            if record.log_time > LATEST:
                self.timeless += 1
            elif record.channel_id in self.channels:
                self.times[record.channel_id].append(record.log_time)
                self.data[record.channel_id].append(record.data)
                self.sequence[record.channel_id].append(record.sequence)
            else:
                self.orphans += 1
        elif isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record
            self.times.setdefault(record.id, [])
            self.data.setdefault(record.id, [])
            self.sequence.setdefault(record.id, [])
        elif isinstance(record, Attachment):
            self.attachments.append(RawAttachment(record.name, record.media_type, record.data))
        elif isinstance(record, Metadata):
            taken = list(record.metadata.items())[: MOST_FACTS - len(self.facts)]
            self.facts.extend(taken)
            self.facts_left_out += len(record.metadata) - len(taken)
        elif isinstance(record, Footer):
            self.complete = True

    def raw_channels(self) -> Iterator[RawChannel]:
        for number, channel in self.channels.items():
            schema = self.schemas.get(channel.schema_id)
            one = RawChannel(
                channel.topic,
                schema.name if schema else "",
                channel.message_encoding,
                schema.encoding if schema else "",
                schema.data.decode(errors="replace") if schema else "",
                channel.metadata.get("offered_qos_profiles", ""),
                np.array(self.times[number], dtype=np.int64),
                tuple(self.data[number]),
            )
            yield in_order(one, self.sequence[number])


def in_order(channel: RawChannel, sequence: Sequence[int] = ()) -> RawChannel:
    """The channel with its messages by time, those of one time by their numbers where a file gives
    them; writers need not keep that order in the file.
    """
    if (np.diff(channel.log_time) >= 0).all():
        return channel
    order = (
        np.lexsort((np.array(sequence), channel.log_time))
        if sequence
        else (np.argsort(channel.log_time, kind="stable"))
    )
    messages = tuple(channel.messages[int(k)] for k in order)
    return replace(channel, log_time=channel.log_time[order], messages=messages)


def read_raw(
    path: str | Path, roots: FileRoots = ANYWHERE, limits: ReadLimits | None = None
) -> RawRecording:
    """Everything readable in an MCAP file; ReadError when there is nothing, or it isn't one.

    Of a recording in several files the first gives all, any other only what it holds. They are
    regular ones below `roots`; what they hold takes no more memory than `limits`.
    """
    chunks = ChunkReader(limits or ReadLimits())
    return with_further_parts(
        _read_file(Path(path), roots, chunks), lambda part: _read_file(part, roots, chunks)
    )


def _read_file(path: Path, roots: FileRoots, chunks: ChunkReader) -> RawRecording:
    """The raw channels of a file, with a sentence for what it lacks. ReadError where it is no MCAP
    file or holds nothing.
    """
    try:
        with roots.open_to_read(path) as stream:
            found = _collect(stream, chunks)
    except FileRefusedError as error:
        raise ReadError(str(error)) from error
    except OSError as error:
        raise ReadError(f"{path} can't be read: {error.strerror}") from error
    except InvalidMagic as error:
        raise ReadError(
            f"{path} is not an MCAP file: its first bytes are others; logs of joints and of power "
            "are for ir energy fit and ir energy compare"
        ) from error
    messages = sum(len(data) for data in found.data.values())
    if found.orphans:
        found.problems.append(f"{found.orphans} messages belong to channels that were lost")
    if found.facts_left_out:
        found.problems.append(
            f"{found.facts_left_out} facts of more than {MOST_FACTS:,} are left out"
        )
    if found.timeless:
        found.problems.append(f"{found.timeless} messages have a time after the year 2260")
    if not found.complete:
        found.problems.append(f"the file ends early; {messages} messages were read up to there")
    if not messages and not found.attachments and not found.facts:
        raise ReadError(
            one_line(f"{path} holds no messages" + "".join(f"; {p}" for p in found.problems))
        )
    lost = [value for name, value in found.facts if name == contents.MESSAGES_LOST]
    found.problems += [f"{value} messages never arrived at the recorder" for value in lost]
    problems = tuple(map(one_line, found.problems))
    return RawRecording(
        path, tuple(found.raw_channels()), tuple(found.attachments), tuple(found.facts), problems
    )


def _collect(stream: BinaryIO, chunks: ChunkReader) -> _Collector:
    """All records of a file up to its end or to where it can't be read on.

    Damage is a sentence among the problems, and what was read before it stays; a file that was cut
    off isn't `complete`. InvalidMagic where it is no MCAP file at all.
    """
    found = _Collector()
    size = os.fstat(stream.fileno()).st_size  # no record is longer than its file
    records = StreamReader(stream, emit_chunks=True, record_size_limit=size).records
    while True:
        try:
            offset = _next_record(stream, found.problems)
            record = next(records)
        except ReadError as error:
            found.problems.append(str(error))
            return found
        except StopIteration:
            return found
        except InvalidMagic:
            if offset == 0:
                raise
            return found  # the closing magic is cut off
        except EndOfFile:
            return found
        except Exception as error:  # damaged bytes make the library raise nearly anything
            found.problems.append(
                f"unreadable record at byte {offset}: {type(error).__name__} {error}".rstrip()
            )
            return found
        try:
            if isinstance(record, Chunk):
                _open_chunk(record, offset, found, chunks)
            else:
                chunks.count(_size(record))
                chunks.describe(record)
                found.add(record)
        except TooLargeError as error:
            found.problems.append(str(error))
            return found


def _next_record(stream: BinaryIO, problems: list[str]) -> int:
    """Goes on to the next record that is read; its place [byte]. Indexes are for readers that
    seek, and an attachment whose check sum is another is named and left out.

    ReadError for a record of maps and texts that is too long to be one.
    """
    while True:
        offset = stream.tell()
        head = stream.read(_HEAD) if offset else b""
        if len(head) < _HEAD:
            stream.seek(offset)
            return offset
        length = int.from_bytes(head[1:], "little")
        if head[0] in _INDEXES:
            stream.seek(length, os.SEEK_CUR)
            continue
        if head[0] == Opcode.ATTACHMENT and not _is_whole(stream.read(length), length):
            problems.append(f"attachment at byte {offset} is damaged: left out")
            continue
        if head[0] not in _LARGE and length > most_of(head[0]):
            raise ReadError(
                f"record at byte {offset} claims {length} bytes, at most {most_of(head[0]):,} are "
                "read of its kind"
            )
        stream.seek(offset)
        return offset


def _is_whole(content: bytes, length: int) -> bool:
    """Whether an attachment's check sum, which may be 0 for none, is that of its bytes."""
    if len(content) < length or length < _CHECK_SUM:
        return True  # cut off, which the next look at the file says
    found = int.from_bytes(content[-_CHECK_SUM:], "little")
    return found in (0, zlib.crc32(content[:-_CHECK_SUM]))


def _size(record: McapRecord) -> int:
    return len(record.data) if isinstance(record, Message | Attachment) else 0


def _open_chunk(chunk: Chunk, offset: int, found: _Collector, chunks: ChunkReader) -> None:
    lost = (
        f"{(chunk.message_end_time - chunk.message_start_time) * 1e-9:.2f} s of messages are lost"
    )
    try:
        records = chunks.records(chunk)
    except TooLargeError:
        raise
    except ReadError as error:
        found.problems.append(f"chunk at byte {offset} is left out, {error}: {lost}")
        return
    except (
        Exception
    ) as error:  # the decompressors raise errors of their own; a lost chunk isn't the end
        found.problems.append(f"chunk at byte {offset} is damaged ({type(error).__name__}): {lost}")
        return
    for record in records:
        found.add(record)


# Which cell of a recording is read: a file may hold several, each in a namespace of its own.

_SHOWN = 8  # namespaces in a sentence


def namespaces_of(raw: RawRecording) -> list[str]:
    """Namespaces of the cells: what stands before the mains meter's topic, else before
    /joint_states.
    """
    for name in (names.POWER_STATE, names.JOINT_STATES):
        topics = [channel.topic for channel in raw.channels if channel.topic.endswith(f"/{name}")]
        if topics:
            return list(dict.fromkeys(topic.removesuffix(f"/{name}") or "/" for topic in topics))
    return []


def chosen_namespace(raw: RawRecording, wanted: str | None) -> tuple[str, str]:
    """The namespace to read, and a sentence where the file holds others too; ReadError for one it
    lacks.
    """
    found = namespaces_of(raw)
    shown = one_line(", ".join(found[:_SHOWN]) or "none", 400)
    if wanted is None:
        sentence = (
            f"the first of the recording's cells is read ({shown}); --namespace chooses another"
        )
        return (found[0] if found else "/"), (sentence if len(found) > 1 else "")
    absolute = f"/{wanted.strip('/')}"
    if absolute not in found:
        raise ReadError(f"no cell {absolute[:200]!r} in the recording; there is: {shown}")
    return absolute, ""


__all__ = ["LATEST", "RawAttachment", "RawChannel", "RawRecording", "read_raw"]
