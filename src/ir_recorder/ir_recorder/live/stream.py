"""Records of what the nodes said lately, which many browsers read, each as fast as it can.

A record holds the time and what has changed since the record before. Nothing waits for a reader:
the newest records are kept, and who falls behind starts anew with them.
"""

from __future__ import annotations

import json
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

from ir_msgs_py.plc import OperatingMode, PlcInputs, PlcOutputs
from ir_recorder.analysis.results import mode_name
from ir_recorder.report.series import Json
from ir_values.errors import one_line

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


# What was heard as values of the stream: bounded texts, and numbers that JSON has.

TEXT = 200  # characters
MOST_MACHINES = 100
_MODE = "operating_mode"


def number(value: float, digits: int = 3) -> float | None:
    """A number to so many digits; None for what JSON has no word for."""
    return round(float(value), digits) if math.isfinite(value) else None


def text(value: object) -> str:
    """One bounded line."""
    return one_line(str(value), TEXT)


def power_values(messages: Sequence[Any]) -> dict[str, Json]:
    """Readings of the mains meter since the last record: lowest and highest watts, the rest of the
    last.
    """
    last = messages[-1]
    watts = [float(m.power) for m in messages if math.isfinite(m.power)]
    return {
        "w": [number(min(watts), 1), number(max(watts), 1)] if watts else None,
        "energy": number(last.energy, 1),
        "mode": mode_name(int(last.mode)),
        "target": mode_name(int(last.target_mode)),
        "plant": text(last.plant),
    }


def levels(message: Any, kind: type[PlcInputs] | type[PlcOutputs]) -> dict[str, Json]:
    """Bits of a message by name, and the operating mode by its name."""
    names = [field.name for field in fields(kind) if field.name not in (_MODE, "stamp_ns")]
    number = int(message.operating_mode)
    mode = OperatingMode(number).name if number in set(OperatingMode) else str(number)
    return {**{name: bool(getattr(message, name)) for name in names}, _MODE: mode}


def states_of(message: Any) -> tuple[tuple[str, str], ...]:
    """Machines with their states as recordings have them, "shut>open" while they change."""
    rows = zip(message.equipment, message.states, message.next, strict=False)
    return tuple((name, f"{state}>{next_}" if next_ else state) for name, state, next_ in rows)


def machines(message: Any) -> list[dict[str, Json]]:
    """States of the machines, and what they change to."""
    rows = zip(message.equipment, message.states, message.next, strict=False)
    return [
        {"name": text(name), "state": text(state), "next": text(next_)}
        for name, state, next_ in list(rows)[:MOST_MACHINES]
    ]
