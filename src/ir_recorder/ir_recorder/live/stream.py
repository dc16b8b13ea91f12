"""What the nodes said lately, as records that many browsers read, each as fast as it can.

A record holds the time and what has changed since the record before. Nothing waits for a reader:
the newest records are kept, and who falls behind starts anew with them.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

SECONDS_KEPT = 120.0
MOST_KEPT = 2_400
"""Records: two minutes at 20 Hz, some 400 kB as text."""
MOST_BYTES = 8_000_000  # of kept records: what strangers publish may be long


class Stream:
    """Records of changing values, kept as text; any thread may add and read."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._start = clock()
        self._epoch = time.time()
        self._news = threading.Condition()
        self._records: deque[tuple[dict[str, Any], bytes]] = deque()
        self._state: dict[str, Any] = {}  # all values now
        self._before: dict[str, Any] = {}  # all values before the first kept record
        self._first = 0  # number of the first kept record
        self._bytes = 0
        self.closed = False

    def now(self) -> float:
        """Seconds since the stream began."""
        return self._clock() - self._start

    def add(self, values: Mapping[str, Any], always: tuple[str, ...] = ()) -> None:
        """Adds a record with what differs from before, and those named in `always`.

        Values are JSON without NaN. A record that would be the same as before is one of the time
        alone.
        """
        changed = {k: v for k, v in values.items() if k in always or self._state.get(k) != v}
        record = {"t": round(self.now(), 3), **changed}
        text = json.dumps(record, separators=(",", ":"), allow_nan=False).encode()
        with self._news:
            self._state.update(changed)
            self._records.append((record, text))
            self._bytes += len(text)
            while len(self._records) > 1 and self._is_too_much(record["t"]):
                old, dropped = self._records.popleft()
                self._before.update(old)
                self._bytes -= len(dropped)
                self._first += 1
            self._news.notify_all()

    def _is_too_much(self, now: float) -> bool:
        oldest = self._records[0][0]["t"]
        return (
            len(self._records) > MOST_KEPT
            or now - oldest > SECONDS_KEPT
            or self._bytes > MOST_BYTES
        )

    def begin(self) -> tuple[bytes, int]:
        """What a reader needs to begin with, as JSON, and the number of the record that comes
        next.
        """
        with self._news:
            before = {"t": self._records[0][0]["t"] if self._records else 0.0, **self._before}
            texts = [text for _, text in self._records]
            following = self._first + len(self._records)
        head = json.dumps({"epoch": self._epoch, "before": before}, allow_nan=False).encode()
        return head[:-1] + b',"records":[' + b",".join(texts) + b"]}", following

    def after(self, number: int, timeout: float) -> tuple[list[bytes], int] | None:
        """Records from `number` on, and the number after them; none of them when nothing came in
        time.

        None where they are no longer kept: the reader begins anew.
        """
        with self._news:
            if number >= self._first + len(self._records) and not self.closed:
                self._news.wait(timeout)
            if number < self._first:
                return None
            kept = [self._records[k][1] for k in range(number - self._first, len(self._records))]
            return kept, number + len(kept)

    def close(self) -> None:
        """Lets all readers go."""
        with self._news:
            self.closed = True
            self._news.notify_all()
