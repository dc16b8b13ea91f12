"""What of a recording is played, and where in it. No ROS, no clock here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from ir_recorder.errors import RecorderError
from ir_recorder.play.commands import is_command


@dataclass(frozen=True)
class PlaySettings:
    """How to play: rate (2 = twice as fast), loop, names or patterns of topics (empty: all visible
    ones).

    Topics that command a robot or a machine are played only by their full name.
    """

    rate: float = 1.0
    loop: bool = False
    topics: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "topics", tuple(self.topics))
        checked_rate(self.rate)

    def plays(self, topic: str, type_name: str = "") -> bool:
        """Whether a topic is played; hidden ones and commands only by name, commands by the full
        one.
        """
        if is_command(topic, type_name):
            return topic in self.topics
        if self.topics:
            return any(fnmatchcase(topic, pattern) for pattern in self.topics)
        return not any(part.startswith("_") for part in topic.split("/"))


@dataclass(frozen=True)
class DueMessage:
    """A message with its place [s after the first] and its recorded time [ns]."""

    at: float
    recorded_ns: int
    topic: str
    data: bytes


def schedule(
    messages: Sequence[tuple[int, str, bytes]], settings: PlaySettings
) -> Iterator[DueMessage]:
    """One pass over messages (log time [ns], topic, data) in the order of time."""
    ordered = sorted((m for m in messages if settings.plays(m[1])), key=lambda message: message[0])
    if not ordered:
        return
    first = ordered[0][0]
    for time, topic, data in ordered:
        yield DueMessage((time - first) * 1e-9, time, topic, data)


def checked_rate(rate: float) -> float:
    """A rate in the range; RecorderError for another."""
    if not 0.001 <= rate <= 1000.0:
        raise RecorderError(f"rate is {rate:g}, must be 0.001 to 1000")
    return rate
