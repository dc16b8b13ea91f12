"""Plays messages when they are due; the clock and the waiting come from outside."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Sequence

from ir_recorder.play.playhead import Playhead
from ir_recorder.play.schedule import DueMessage, PlaySettings, schedule

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
            left = min(left, _PAUSED) if math.isinf(left) else left
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
