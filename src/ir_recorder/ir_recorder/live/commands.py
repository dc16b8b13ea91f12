"""What browsers ask for, handed from their threads to the node's and answered there."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field, fields

from ir_msgs_py.plc import PlcInputs
from ir_recorder.live.server import Answer

BITS = tuple(field.name for field in fields(PlcInputs) if field.name != "operating_mode")
MOST_WAITING = 16
PATIENCE = 5.0
"""s: a driver answers within 20 ms."""


_UNANSWERED = Answer(False, f"the driver has not answered within {PATIENCE:g} s")


@dataclass(eq=False)
class Command:
    """A level asked for; `answer` lets the browser's thread go on, once."""

    name: str
    value: bool
    _done: threading.Event = field(default_factory=threading.Event)
    _answer: Answer = _UNANSWERED

    def answer(self, done: bool, sentence: str) -> None:
        """Says what came of it."""
        self._answer = Answer(done, sentence)
        self._done.set()

    def wait(self) -> Answer:
        """The answer, or that there was none in time."""
        self._done.wait(PATIENCE)
        return self._answer


class Commands:
    """A short queue; `press` is called by browsers' threads, `take` by the node."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Command] = queue.Queue(MOST_WAITING)

    def press(self, name: str, value: bool) -> Answer:
        """Asks and waits; refuses what is no bit, and what comes faster than it is answered."""
        if name not in BITS:
            return Answer(False, f"{name[:60]!r} is no bit of the PLC: known are {', '.join(BITS)}")
        command = Command(name, value)
        try:
            self._queue.put_nowait(command)
        except queue.Full:
            return Answer(False, f"{MOST_WAITING} requests wait already")
        return command.wait()

    def take(self) -> Iterator[Command]:
        """What has been asked since the last time."""
        while True:
            try:
                yield self._queue.get_nowait()
            except queue.Empty:
                return
