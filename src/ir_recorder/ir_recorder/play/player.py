"""Plays messages at their due times; the clock and the waiting come from outside."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ir_recorder.play.schedule import DueMessage, PlaySettings, schedule

Publish = Callable[[DueMessage], None]
Tick = Callable[[int], None]


class Player:
    """Hands messages to `publish` when they are due.

    now() [s] is a clock that never jumps; wait(seconds) returns True when playback shall end.
    tick(recorded_ns) is called at least every `tick_period` seconds of waiting, for /clock.
    """

    def __init__(
        self,
        now: Callable[[], float],
        wait: Callable[[float], bool],
        publish: Publish,
        tick: Tick | None = None,
        tick_period: float = 0.01,
    ) -> None:
        self._now, self._wait, self._publish = now, wait, publish
        self._tick, self._period = tick, tick_period
        self._next_tick = 0.0

    def play(self, messages: Sequence[tuple[int, str, bytes]], settings: PlaySettings) -> int:
        """Plays to the end, or for ever where `loop`; returns how many messages were published."""
        count = 0
        while True:
            start, before = self._now(), count
            self._next_tick = 0.0
            for message in schedule(messages, settings):
                if not self._until(message, start, settings.rate):
                    return count
                self._publish(message)
                count += 1
            if not settings.loop or count == before:
                return count

    def _until(self, message: DueMessage, start: float, rate: float) -> bool:
        """Waits until the message is due; False when playback shall end."""
        while True:
            passed = self._now() - start
            if self._tick is not None and passed >= self._next_tick:
                self._tick(message.recorded_ns - round(max(message.due - passed, 0.0) * rate * 1e9))
                self._next_tick = passed + self._period
            left = message.due - passed
            if left <= 0.0:
                return not self._wait(0.0)
            if self._tick is not None:
                left = min(left, max(self._next_tick - passed, 0.0))
            if self._wait(left):
                return False
