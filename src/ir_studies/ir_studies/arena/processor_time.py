"""Processor time of this process and of those in which OMPL answers it, without what it takes to
start them.

A clock for comparisons: on a machine that others use too, seconds of the wall say who had to wait.
A process that is forked for each request is how OMPL is made repeatable here, not what its planners
need.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_SCHEDULED = 2  # Linux: the clock of a process counts what its threads ran
_running: dict[int, float] = {}  # s that each had run when it was last looked at
_ended = 0.0
_start = 0.0  # s of each process that count for nobody


def processor_time() -> float:
    """Seconds that this process has run, and those in which OMPL has answered it or does so now;
    for who asks from one thread.
    """
    return time.process_time() + others_time()


def others_time() -> float:
    """Of the same, the seconds of other processes alone."""
    return _ended + sum(map(_used, tuple(_running)))


def excuse(seconds: float) -> None:
    """From now on so many seconds of each process that is charged count for nobody."""
    global _start
    _start = seconds


@contextmanager
def charged(process: int) -> Iterator[None]:
    """Count a process for as long as this lasts."""
    global _ended
    _running[process] = 0.0
    try:
        yield
    finally:
        _ended += _used(process)
        del _running[process]


def _used(process: int) -> float:
    """Seconds that a process has run since it was started up; where it is gone, when it was last
    seen.
    """
    with suppress(OSError):
        _running[process] = max(time.clock_gettime((~process << 3) | _SCHEDULED) - _start, 0.0)
    return _running[process]
