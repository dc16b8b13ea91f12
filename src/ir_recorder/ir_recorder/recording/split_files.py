"""Split files of a recording: whether their paths are free, what each repeats so that it can be
read alone, and where a recording goes on that lost its file.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Sequence
from glob import escape
from pathlib import Path

from mcap.exceptions import McapError
from mcap.records import Chunk, Message, Metadata
from mcap.stream_reader import StreamReader

from ir_recorder.errors import RecorderError
from ir_recorder.format import contents
from ir_recorder.format.contents import Split, part_path
from ir_recorder.format.qos import QosOffer
from ir_recorder.recording.writer import checked_path
from ir_values.errors import FileRefusedError
from ir_values.files import ANYWHERE


def check_free(path: str | Path, split: Split, overwrite: bool = False) -> None:
    """RecorderError where a further file of a recording would meet another one; with `overwrite`,
    one that is no part of the recording that is replaced.
    """
    first = checked_path(path)
    if not split.wanted:
        return
    replaced = recording_of(first) if overwrite else ""
    for other in first.parent.glob(f"{escape(first.stem)}_*{first.suffix}"):
        number = other.stem.removeprefix(f"{first.stem}_")
        if not (number.isascii() and number.isdecimal()) or part_path(first, int(number)) != other:
            continue
        if not overwrite:
            raise RecorderError(f"{other} is there already; choose another path or set overwrite")
        if not replaced or recording_of(other) != replaced:
            raise RecorderError(
                f"{other} is no part of {first.name}: it is not replaced; choose another path"
            )


def recording_of(path: Path) -> str:
    """The recording that a file is a part of, by the facts that it begins with; "" for a file that
    is there without any, or not there.
    """
    try:
        with ANYWHERE.open_to_read(path) as stream:
            for record in StreamReader(stream).records:
                if isinstance(record, Metadata) and record.name == contents.PARTS:
                    return record.metadata.get(contents.RECORDING, "")
                if isinstance(record, (Chunk, Message)):
                    return ""
    except (OSError, FileRefusedError, McapError, ValueError, struct.error):
        return ""
    return ""


def continued_path(lost: Path) -> Path:
    """The file in which a recording goes on that lost its own: shift_continued.mcap; RecorderError
    where there are too many.
    """
    for number in range(1, 100):
        name = f"{lost.stem}_continued{'' if number == 1 else f'_{number}'}{lost.suffix}"
        if not lost.with_name(name).exists():
            return lost.with_name(name)
    raise RecorderError(f"{lost.with_name(name)} and all before are there already")


class LatchedMessages:
    """The last messages of latched topics, as many as there are publishers."""

    def __init__(self) -> None:
        self._kept: dict[str, deque[bytes]] = {}

    def open(self, topic: str, offers: Sequence[QosOffer]) -> None:
        """Keep those of a topic, where its publishers latch."""
        if offers and all(offer.transient_local for offer in offers):
            self._kept[topic] = deque(maxlen=len(offers))

    def keep(self, topic: str, data: bytes) -> None:
        """A message of any topic."""
        if topic in self._kept:
            self._kept[topic].append(data)

    def all(self) -> list[tuple[str, bytes]]:
        """Topics and messages."""
        return [(topic, data) for topic, kept in self._kept.items() for data in kept]

    def counts(self) -> dict[str, int]:
        """How many there are of each topic."""
        return {topic: len(kept) for topic, kept in self._kept.items() if kept}
