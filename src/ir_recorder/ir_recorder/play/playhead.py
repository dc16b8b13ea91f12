"""Where playback stands: it goes on with the clock, at a rate, unless it is paused; and it may be
moved.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass

from ir_recorder.errors import RecorderError
from ir_recorder.play.schedule import checked_rate


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
