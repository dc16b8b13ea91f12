"""Playback without ROS: the schedule of a recording, the playhead, and the player."""

from __future__ import annotations

import math
import threading
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from ir_msgs_py import names
from ir_recorder.errors import RecorderError

_LONGEST = 3600.0  # s of one wait; a gap may be longer than a thread can wait

# Topics that move a robot or a machine: playback leaves them out unless one is asked for by
# name.

COMMANDS = (names.COMMANDED_TRAJECTORY, names.PLC_INPUTS, names.SPEED_SCALING, names.SIGNALS)
TYPES = (  # commands of any controller, whatever their topic is called
    "trajectory_msgs/msg/JointTrajectory",
    "trajectory_msgs/msg/MultiDOFJointTrajectory",
    "control_msgs/msg/JointJog",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
    "std_msgs/msg/Float64MultiArray",
    "ir_msgs/msg/PlcInputs",
    "ir_msgs/msg/Signal",
)
# nodes only report here
SHOWN = (
    names.PLANNED_TRAJECTORY,
    names.PLC_INPUTS_IN_FORCE,
    names.MACHINE_SIGNALS,
)


def is_command(topic: str, type_name: str = "") -> bool:
    """Whether messages of this topic may move something, by its name in any namespace or by its
    type.
    """
    if any(_ends(topic, name) for name in COMMANDS):
        return True
    return type_name in TYPES and not any(_ends(topic, name) for name in SHOWN)


def _ends(topic: str, name: str) -> bool:
    return topic == f"/{name}" or topic.endswith(f"/{name}")


# What of a recording is played, and where in it. No ROS, no clock here.


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


def checked_delay(delay: float) -> float:
    """A delay [s] in the range; RecorderError for another."""
    if not 0.0 <= delay <= _LONGEST:
        raise RecorderError(f"delay is {delay:g} s, must be 0 to {_LONGEST:g} s")
    return delay


# Where playback stands: it goes on with the clock, at a rate, unless it is paused; and it may be
# moved.


@dataclass(frozen=True)
class PlayState:
    """position and duration [s from the start of the recording]; rate: recorded seconds in a
    second.
    """

    paused: bool
    rate: float
    position: float
    duration: float


class Playhead:
    """Safe to use from several threads. now() [s] is a clock that never jumps; `jumps` counts
    seeks.
    """

    def __init__(self, now: Callable[[], float], duration: float, rate: float = 1.0) -> None:
        self._now = now
        self._duration = duration
        self._lock = threading.Lock()
        self._rate = rate
        self._paused = False
        self._at = 0.0
        self._since = now()
        self.jumps = 0

    @property
    def state(self) -> PlayState:
        """As it is now."""
        with self._lock:
            return PlayState(self._paused, self._rate, self._here(), self._duration)

    def begin(self) -> None:
        """Playback begins now, wherever it stands."""
        with self._lock:
            self._since = self._now()

    def control(self, pause: bool, rate: float = 0.0, seek: float = -1.0) -> None:
        """Pause or go on; rate 0: as before; seek negative: from here. RecorderError for what can't
        be.
        """
        if math.isnan(seek) or seek > self._duration:
            raise RecorderError(
                f"seek is {seek:g} s, must be at most {self._duration:g} s, the recording's "
                "duration"
            )
        rate = checked_rate(rate) if rate != 0.0 else 0.0
        with self._lock:
            self._at = self._here() if seek < 0.0 else seek
            self._since = self._now()
            self._paused = pause
            self._rate = rate or self._rate
            self.jumps += seek >= 0.0

    def left(self, at: float) -> float:
        """Seconds of the clock until the recording's second `at`; infinite while it is paused."""
        with self._lock:
            return math.inf if self._paused else (at - self._here()) / self._rate

    def _here(self) -> float:
        passed = 0.0 if self._paused else (self._now() - self._since) * self._rate
        return min(self._at + passed, self._duration)


# Plays messages when they are due; the clock and the waiting come from outside.

Publish = Callable[[DueMessage], None]
Tick = Callable[[int], None]
_PAUSED = 1.0  # s between two looks while nothing is due


class Player:
    """Hands messages to `publish` when they are due.

    now() [s] is a clock that never jumps; wait(seconds) returns True when playback shall end, and
    may return early. tick(recorded_ns) is called at least every `tick_period` seconds of waiting,
    for /clock. head: by which others control it. latched: topics whose last message is published
    again after a seek.
    """

    def __init__(
        self,
        now: Callable[[], float],
        wait: Callable[[float], bool],
        publish: Publish,
        tick: Tick | None = None,
        tick_period: float = 0.01,
        head: Playhead | None = None,
        latched: Collection[str] = (),
    ) -> None:
        self._now = now
        self._wait = wait
        self._publish = publish
        self._tick = tick
        self._period = tick_period
        self._next_tick = -math.inf
        self._head = head
        self._latched = latched

    def play(self, messages: Sequence[tuple[int, str, bytes]], settings: PlaySettings) -> int:
        """Plays to the end, or for ever where `loop`; returns how many messages were published."""
        ordered = list(schedule(messages, settings))
        if not ordered:
            return 0
        head = self._head or Playhead(self._now, ordered[-1].at, settings.rate)
        head.begin()
        count = 0
        index = 0
        jumps = 0
        while True:
            if jumps != head.jumps:
                jumps = head.jumps
                index = bisect_left(ordered, head.state.position, key=lambda message: message.at)
                count += self._restore(ordered[:index])
            if index == len(ordered):
                if not settings.loop:
                    return count
                head.control(pause=False, seek=0.0)
                index = 0
                jumps = head.jumps
            due = self._until(ordered[index], ordered[0].recorded_ns, head, jumps)
            if due is None:
                return count
            if due:
                self._publish(ordered[index])
                index = index + 1
                count = count + 1

    def _until(self, message: DueMessage, start_ns: int, head: Playhead, jumps: int) -> bool | None:
        """Waits until the message is due: True; False after a seek, None when playback shall
        end.
        """
        while jumps == head.jumps:
            now = self._now()
            left = head.left(message.at)
            if self._tick is not None and now >= self._next_tick:
                self._tick(start_ns + round(min(head.state.position, message.at) * 1e9))
                self._next_tick = now + self._period
            if left <= 0.0:
                return None if self._wait(0.0) else True
            left = _PAUSED if math.isinf(left) else min(left, _LONGEST)
            if self._tick is not None:
                left = min(left, max(self._next_tick - now, 0.0))
            if self._wait(left):
                return None
        return False

    def _restore(self, before: Sequence[DueMessage]) -> int:
        """What was latched when the recording came to a place; how many messages."""
        last = {message.topic: message for message in before if message.topic in self._latched}
        for message in last.values():
            self._publish(message)
        return len(last)
