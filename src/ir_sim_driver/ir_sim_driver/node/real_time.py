"""A thread of its own for a stream with absolute deadlines: it ticks at the stamps of a grid."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from ir_sim_driver.node.grid import ClockPolicy, Grid

_NS = 1_000_000_000
_POLL = 0.002  # s, while a clock stands still or has not started
_STEP_MAX = (
    _NS // 10
)  # ns of real time that a scaled clock counts between two looks; more is a suspension


class GridThread:
    """Calls `tick(stamp_ns)` for every multiple of period_ns of `clock` until it is closed.

    on_gap: called with a sentence when the grid begins anew. on_failure: called with what `tick`
    raised; the thread ends then. lag [s]: the present delay; worst_lag [s]: the longest so far.
    """

    def __init__(
        self,
        period_ns: int,
        clock: Callable[[], int],
        policy: Callable[[], ClockPolicy],
        tick: Callable[[int], None],
        on_gap: Callable[[str], None],
        on_failure: Callable[[Exception], None],
        wall: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._grid = Grid(period_ns)
        self._clock = clock
        self._policy = policy
        self._wall = wall
        self._tick = tick
        self._on_gap = on_gap
        self._on_failure = on_failure
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="plant", daemon=True)
        self.worst_lag = 0.0

    @property
    def lag(self) -> float:
        """Present delay [s]."""
        return self._grid.lag

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
        grid = self._grid
        while not self._closing.is_set():
            wait = grid.look(self._clock(), self._wall(), self._policy())
            if grid.gap:
                self._on_gap(grid.gap)
            if wait > 0:
                time.sleep(min(wait / _NS, _POLL))
            else:
                self.worst_lag = max(self.worst_lag, grid.lag)
                self._tick(grid.take())


class ScaledClock:
    """Nanoseconds that pass `factor` times as fast as real time, from `start_ns` on.

    While nobody looks at it, as in a process that is suspended, it stands.
    """

    def __init__(
        self, factor: float, start_ns: int, wall: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._factor = factor
        self._now = start_ns
        self._wall = wall
        self._seen = wall()

    def __call__(self) -> int:
        """Present time [ns]."""
        seen = self._seen
        self._seen = self._wall()
        self._now += int(self._factor * min(self._seen - seen, _STEP_MAX))
        return self._now
