"""A recording as bytes by topic, with its attachments and facts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ir_msgs_py.arrays import IntArray


@dataclass(frozen=True)
class RawChannel:
    """One topic's messages as bytes; log_time (N,) [ns] in the order of the file."""

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
