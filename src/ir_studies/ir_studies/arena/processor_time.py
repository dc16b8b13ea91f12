"""Processor time of this process and of those in which OMPL answers it.

A clock for comparisons: on a machine that others use too, seconds of the wall say who had to wait.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

_SCHEDULED = 2  # Linux: the clock of a process counts what its threads ran
_running: set[int] = set()
_ended = 0.0


def processor_time() -> float:
    """Seconds that this process has run, and those in which OMPL has answered it or does so now; for who asks
    from one thread.
    """
    return time.process_time() + _ended + sum(map(_used, tuple(_running)))


@contextmanager
def charged(process: int) -> Iterator[None]:
    """Count a process for as long as this lasts."""
    global _ended
    _running.add(process)
    try:
        yield
    finally:
        _ended += _used(process)
        _running.discard(process)


def _used(process: int) -> float:
    """Seconds that a process has run; none where it is gone."""
    try:
        return time.clock_gettime((~process << 3) | _SCHEDULED)
    except OSError:
        return 0.0
