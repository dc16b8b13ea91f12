"""What happened in browsers, for the one thread that changes anything: the latest of each kind
counts.

A quick hand drags a machine through a hundred places a second; of those that wait only the last is
looked at.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

Action = Callable[[], None]


class Inbox:
    """Actions by key, filled by any thread, emptied by one."""

    def __init__(self) -> None:
        self._waiting: dict[str, Action] = {}
        self._changed = threading.Condition()

    def post(self, key: str, action: Action) -> None:
        """Keep an action; one with the same key that still waits is dropped."""
        with self._changed:
            self._waiting.pop(key, None)
            self._waiting[key] = action
            self._changed.notify()

    def take(self, patience: float) -> list[Action]:
        """All that waits, in the order in which it came; after at most `patience` s none."""
        with self._changed:
            if not self._waiting:
                self._changed.wait(patience)
            actions = list(self._waiting.values())
            self._waiting.clear()
            return actions
