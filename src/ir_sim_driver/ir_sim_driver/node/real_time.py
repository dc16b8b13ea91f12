"""The plant's thread: it ticks at the stamps of a gap-free grid."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from math import inf

# Grid of stamps, on a clock that may lag, stop and jump.
#
# A thread that gets too little of the processor lags: what it has missed is made up for stamp by
# stamp, no faster than `catch_up` times the clock. A process that got none of it for long was
# suspended, which looks as if the clock had jumped: the grid has a gap then, with the reason. The
# two differ only in how often the grid could look at the clock.

_NS = 1_000_000_000
_BACK = _NS // 2  # a clock that is this far behind the next stamp has jumped
# a delay of up to this is made up for at once: no gap in what others see is shorter
_AT_ONCE = _NS // 10
# of an advance of the clock in which the process can't have looked: it was suspended
_WALL_SHARE = 0.5


@dataclass(frozen=True)
class ClockPolicy:
    """How a clock is followed.

    gap [s]: an advance between two looks that is a gap. lag [s]: a delay that is one, however it
    came about.
    catch_up: speed in times the clock's, at which delays are made up for. nap [s]: between two
    looks at most, while no stamp is due.
    """

    gap: float
    lag: float
    catch_up: float
    nap: float = 0.002


SYSTEM = ClockPolicy(gap=2.0, lag=inf, catch_up=2.0, nap=0.02)
"""The host's clock: a loaded machine lags as long as it is loaded. Two seconds without a look at
the clock are no load: its threads wait for tenths of one, and for a whole one while a huge message
is read. It says when a stamp is due: to look more often costs a slow stream more than its stamps.
"""
FOREIGN = ClockPolicy(gap=5.0, lag=5.0, catch_up=inf)
"""Somebody's /clock, which comes in steps and at any speed."""
OWN = ClockPolicy(gap=inf, lag=inf, catch_up=inf)
"""A clock that the driver itself publishes: nobody sees a delay."""


class Grid:
    """Stamps on multiples of period_ns.

    gap: why the grid began anew in the last look, "" where it did not. lag [s]: of the next stamp,
    then.
    """

    def __init__(self, period_ns: int) -> None:
        self._period = period_ns
        self._stamp = 0  # the next one; 0: the grid has not begun
        self._reach = 0.0  # stamps up to here may be taken now
        self._seen = 0
        self._wall = 0
        self.gap = ""
        self.lag = 0.0

    def look(self, now: int, wall: int, policy: ClockPolicy) -> int:
        """Nanoseconds until a stamp is due, 0 or less: `take` it.

        now: the clock, 0 where it has not started. wall: a clock of the process that nobody sets,
        both [ns].
        """
        advance = now - self._seen
        passed = wall - self._wall
        self._seen = now
        self._wall = wall
        self.gap = ""
        if now <= 0:
            self._restart("the clock has stopped" if self._stamp else "")
            return self._period
        if self._stamp:
            self.gap = self._gap(now, advance, passed, policy)
        if self._stamp == 0 or self.gap:
            self._stamp = (now // self._period + 1) * self._period
            self._reach = now
        else:
            self._reach = min(now, self._allowed(advance, policy))
        self.lag = max(0.0, (now - self._stamp) / _NS)
        return self._wait(now, policy)

    def take(self) -> int:
        """The stamp that is due."""
        self._stamp += self._period
        return self._stamp - self._period

    def _restart(self, reason: str) -> None:
        self.gap = reason
        self._stamp = 0
        self.lag = 0.0

    def _allowed(self, advance: int, policy: ClockPolicy) -> float:
        """Up to where stamps may be taken after the clock has advanced so far."""
        if policy.catch_up == inf:
            return inf
        return min(self._reach + policy.catch_up * max(advance, 0), self._stamp + _AT_ONCE)

    def _wait(self, now: int, policy: ClockPolicy) -> int:
        if self._stamp > now:
            return self._stamp - now
        return max(0, int((self._stamp - self._reach) / policy.catch_up))

    def _gap(self, now: int, advance: int, passed: int, policy: ClockPolicy) -> str:
        if self._stamp - now > _BACK:
            return f"the clock jumped back by {(self._stamp - now) / _NS:.3f} s"
        if advance > policy.gap * _NS:
            suspended = passed > _WALL_SHARE * advance
            verb = "the process was suspended for" if suspended else "the clock jumped ahead by"
            return f"{verb} {advance / _NS:.3f} s"
        if now - self._stamp > policy.lag * _NS:
            return f"the plant has fallen behind the clock by {(now - self._stamp) / _NS:.3f} s"
        return ""


# Thread with absolute deadlines.

# ns of real time that a scaled clock counts between two looks; more is a suspension
_STEP_MAX = _NS // 10


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
            policy = self._policy()
            wait = grid.look(self._clock(), self._wall(), policy)
            if grid.gap:
                self._on_gap(grid.gap)
            if wait > 0:
                time.sleep(min(wait / _NS, policy.nap))
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
