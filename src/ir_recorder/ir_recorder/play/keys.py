"""Keys of a terminal that control playback: space pauses, arrows seek and change the rate."""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ir_recorder.play.playhead import Playhead

HELP = (
    "space: pause; left, right: 5 s back and on; up, down: twice and half the rate; 0: from "
    "the start"
)
_STEP = 5.0  # s of the recording
_PATIENCE = 0.1  # s between two looks whether playback has ended
_SLOWEST = 0.001
_FASTEST = 1000.0


def press(key: bytes, head: Playhead) -> None:
    """What a key does; keys without a meaning do nothing."""
    state = head.state
    if key == b" ":
        head.control(not state.paused)
    elif key == b"0":
        head.control(state.paused, seek=0.0)
    elif key in (b"\x1b[C", b"\x1b[D"):
        step = _STEP if key == b"\x1b[C" else -_STEP
        head.control(state.paused, seek=min(max(state.position + step, 0.0), state.duration))
    elif key in (b"\x1b[A", b"\x1b[B"):
        rate = state.rate * (2.0 if key == b"\x1b[A" else 0.5)
        head.control(state.paused, rate=min(max(rate, _SLOWEST), _FASTEST))


@contextmanager
def keys_of_terminal(pressed: Callable[[bytes], None]) -> Iterator[bool]:
    """Hand on keys while the block runs; whether there is a terminal. It is left as it was."""
    if not sys.stdin.isatty():
        yield False
        return
    terminal = sys.stdin.fileno()
    ended = threading.Event()
    before = termios.tcgetattr(terminal)

    def read() -> None:
        while not ended.is_set():
            if select.select([terminal], [], [], _PATIENCE)[0]:
                pressed(os.read(terminal, 8))

    tty.setcbreak(terminal)
    thread = threading.Thread(target=read, name="keys", daemon=True)
    thread.start()
    try:
        yield True
    finally:
        ended.set()
        thread.join()
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
