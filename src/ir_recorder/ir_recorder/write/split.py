"""What a further file of a recording repeats, so that it can be read alone."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path

from ir_recorder.errors import PathError
from ir_recorder.format.parts import Split, part_path
from ir_recorder.format.qos import QosOffer
from ir_recorder.write.writer import checked_path


def check_free(path: str | Path, split: Split) -> None:
    """PathError where the second file of a recording would meet another one."""
    second = part_path(checked_path(path), 1)
    if split.wanted and second.exists():
        raise PathError(f"{second} is there already; choose another path or set overwrite")


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
