"""A node as a process: made, spun until SIGINT or SIGTERM, cleaned up while its context is still
whole.

rclpy's own signal handlers end the context under the executor and the clean-up, which then fail in
many ways (ExternalShutdownException, RCLError, KeyboardInterrupt in any line). Here a signal only
ends the spinning, and a second one finds nothing to cut short.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TypeVar

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
)
from rclpy.node import Node

from ir_msgs_py.checks import one_line
from ir_msgs_py.errors import ParameterError
from ir_msgs_py.ros.clock_guard import heed_times_only
from ir_msgs_py.ros.command_line import CommandLineError, answer_before_start, init_ros
from ir_msgs_py.ros.network import apply_network

N = TypeVar("N", bound=Node)
LOOK = 0.1  # s between two looks whether a node goes on
FAILURES_MAX = 50
FAILURES_WITHIN = 60.0
"""So many callbacks may fail within so many seconds: a node that fails more often does nothing
useful.
"""


class Spinning:
    """Spins an executor in the thread that calls `run`, until any thread calls `end`."""

    def __init__(self) -> None:
        self._ended = threading.Event()
        self._executor: Executor | None = None

    def run(
        self, executor: Executor, goes_on: Callable[[], bool] | None = None, look: float = LOOK
    ) -> None:
        """Return after `end`, when the executor's context has ended, or at most `look` [s] after
        goes_on() is False.

        Raises what a callback raises; `run` may be called again then.
        """
        self._executor = executor
        context = executor.context
        period = None if goes_on is None else look
        try:
            while not self._ended.is_set() and context.ok() and (goes_on is None or goes_on()):
                executor.spin_once(timeout_sec=period)
        except (ExternalShutdownException, ShutdownException):
            return
        except RCLError:
            if context.ok():
                raise  # else somebody ended the context between two lines of the executor

    def end(self) -> None:
        """Let `run` return after the present callback."""
        if self._ended.is_set():
            return
        self._ended.set()
        executor = self._executor
        if executor is not None:
            executor.create_task(_nothing)  # waking alone does not end a wait, work does


def run_node(
    name: str,
    make: Callable[[], N],
    arguments: Sequence[str] | None = None,
    *,
    executor: Callable[[], Executor] = SingleThreadedExecutor,
    refusals: tuple[type[Exception], ...] = (),
    goes_on: Callable[[N], bool] | None = None,
    look: float = LOOK,
    about: str = "",
) -> int:
    """Make a node, spin it until a signal or until `look` [s] after goes_on(node) is False; the
    exit code.

    Each look holds the interpreter for about a millisecond. about: what the node does, for --help;
    "" where its own words were read before. refusals: what `make` or the clean-up raises for
    reasons that a sentence on stderr explains (exit code 1). Call it in the main thread, last of
    all: its signals stay taken.
    """
    words = sys.argv[1:] if arguments is None else arguments
    if about and (answer := answer_before_start(name, words, about)) is not None:
        return answer
    expected: tuple[type[Exception], ...] = (CommandLineError, ParameterError, *refusals)
    spinning = Spinning()
    _on_signals(spinning.end)
    try:
        apply_network()
        init_ros(arguments)
        node = make()
        try:
            spins = executor()
            spins.add_node(node)
            spin(spinning, spins, node, None if goes_on is None else lambda: goes_on(node), look)
            spins.remove_node(node)
        finally:
            node.destroy_node()
    except expected as error:
        sys.stderr.write(f"{name}: {_printable(error)}\n")
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


def _printable(error: Exception) -> str:
    """What it says, line by line."""
    return "\n".join(one_line(line) for line in str(error).splitlines())


def spin(
    spinning: Spinning,
    executor: Executor,
    node: Node,
    goes_on: Callable[[], bool] | None,
    look: float = LOOK,
) -> None:
    """Spin to the end; what a callback raises is logged, and ends the node only when it comes too
    often.
    """
    failures: deque[float] = deque(maxlen=FAILURES_MAX)
    heed_times_only(node)
    while True:
        try:
            return spinning.run(executor, goes_on, look)
        except Exception as error:  # one callback must not end the node for all others
            now = time.monotonic()
            if len(failures) == FAILURES_MAX and now - failures[0] < FAILURES_WITHIN:
                raise
            failures.append(now)
            node.get_logger().error(one_line(f"a callback failed: {error!r}"))


def _on_signals(act: Callable[[], None]) -> None:
    """Call `act` in a thread of its own at each SIGINT or SIGTERM, also while the main thread is in
    C.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)

    def listen() -> None:
        while os.read(reading, 1):
            act()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _ignore)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=listen, name="signals", daemon=True).start()


def _ignore(number: int, frame: object) -> None:
    """What Python does in the main thread when it comes to it: nothing more."""


def _nothing() -> None:
    """A task that ends a wait."""
