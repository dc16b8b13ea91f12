"""A thread of its own for a stream with absolute deadlines: stamps on a gap-free grid of the clock.

After a hiccup it catches up, stamp by stamp. Only when the clock itself jumps, back or farther ahead than
`max_lag`, the grid starts anew, and `on_jump` is called.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

_NS = 1_000_000_000
_POLL = 0.002  # s, while a clock stands still or has not started
_BACK = _NS // 2  # a clock that is this far behind the next stamp has jumped


class GridThread:
    """Calls `tick(stamp_ns)` for every multiple of period_ns of `clock` until it is closed.

    on_jump: called with a sentence when the clock has jumped. on_failure: called with what `tick` raised;
    the thread ends then.
    """

    def __init__(
        self,
        period_ns: int,
        clock: Callable[[], int],
        tick: Callable[[int], None],
        on_jump: Callable[[str], None],
        on_failure: Callable[[Exception], None],
        max_lag: float = 5.0,
    ) -> None:
        self._period, self._clock, self._tick = period_ns, clock, tick
        self._on_jump, self._on_failure = on_jump, on_failure
        self._max_lag = max_lag * _NS
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="plant", daemon=True)
        self.worst_lag = 0.0

    def start(self) -> None:
        """Begin at the next stamp."""
        self._thread.start()

    def close(self) -> None:
        """End after the present tick."""
        self._closing.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        try:
            self._loop()
        except Exception as error:  # whatever it is: the plant must not stop silently
            if not self._closing.is_set():
                self._on_failure(error)

    def _loop(self) -> None:
        stamp = 0
        while not self._closing.is_set():
            now = self._clock()
            if now <= 0:  # simulated time that has not started
                time.sleep(_POLL)
                continue
            if stamp == 0:
                stamp = (now // self._period + 1) * self._period
            ahead = stamp - now
            if ahead > _BACK or -ahead > self._max_lag:
                where = "back" if ahead > 0 else "ahead"
                self._on_jump(f"the clock jumped {where} by {abs(ahead) / _NS:.3f} s")
                stamp = 0
            elif ahead > 0:
                time.sleep(min(ahead / _NS, _POLL))
            else:
                self.worst_lag = max(self.worst_lag, -ahead / _NS)
                self._tick(stamp)
                stamp += self._period


class ScaledClock:
    """Nanoseconds that pass `factor` times as fast as real time, from `start_ns` on."""

    def __init__(self, factor: float, start_ns: int) -> None:
        self._factor, self._start = factor, start_ns
        self._origin = time.monotonic_ns()

    def __call__(self) -> int:
        """Present time [ns]."""
        return self._start + int((time.monotonic_ns() - self._origin) * self._factor)
