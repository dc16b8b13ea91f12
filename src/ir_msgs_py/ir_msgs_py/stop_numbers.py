"""Numbers of stops: each says which driver process the stop belongs to, and counts its stops.

A number is the time at which its driver was started [ms since 1970] times a million, plus the count
of its stops: no two processes have a number in common, and later ones are greater.
"""

from __future__ import annotations

import time

_OF_A_DRIVER = 1_000_000
_NS_PER_MS = 1_000_000


def before_first_stop() -> int:
    """The number that a driver process which starts now has before its first stop."""
    return time.time_ns() // _NS_PER_MS * _OF_A_DRIVER


def stop_count(number: int) -> int:
    """The how many'th stop of its driver process this is, 0: none came yet."""
    return number % _OF_A_DRIVER


def same_driver(number: int, other: int) -> bool:
    """Whether two numbers are of one driver process."""
    return number // _OF_A_DRIVER == other // _OF_A_DRIVER
