"""Executors that spin until they are ended: in the calling thread, or in one of their own; and what
ends a wait for their answers.

Entities of a node that spins in the background are only touched by `run`: clients, and action
clients above all, race when they are used from two threads.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rclpy.context import Context
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
)
from rclpy.node import Node
from rclpy.task import Future

from ir_msgs_py.ros.rclpy_inside import RCLError, survive_clients

T = TypeVar("T")
LOOK = 0.1  # s between two looks whether a node goes on
_POLL = 0.005  # s, for conditions that nobody announces, as the discovery of a service
_SLICE = 0.1  # s of a wait between two looks whether a callback has failed
_LAST_CALLBACK = 60.0  # s that it may take; nodes are not taken apart under it


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


class Cancellation:
    """Whether what is waited for is not wanted any more: canceled once, by any thread, which ends
    the waits for it at that moment.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._canceled = False
        self._callbacks: list[Callable[[], object]] = []

    @property
    def canceled(self) -> bool:
        """Whether `cancel` was called."""
        return self._canceled

    def cancel(self) -> None:
        """Cancel it, and end the waits; a second time is nothing."""
        with self._lock:
            self._canceled = True
            callbacks = self._callbacks
            self._callbacks = []
        for callback in callbacks:
            callback()

    @contextmanager
    def calling(self, callback: Callable[[], object]) -> Iterator[None]:
        """Meanwhile call back when it is canceled, from the thread that cancels it; at once where
        it is already.
        """
        with self._lock:
            before = self._canceled
            if not before:
                self._callbacks.append(callback)
        if before:
            callback()
        try:
            yield
        finally:
            with self._lock:
                if callback in self._callbacks:
                    self._callbacks.remove(callback)


class BackgroundExecutor:
    """Spins the nodes of one context until it is closed; also a context manager.

    What a callback raises is raised where somebody waits, and spinning goes on.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._executor = SingleThreadedExecutor(context=context)
        self._nodes: list[Node] = []
        self._failure: BaseException | None = None
        self._spinning = Spinning()
        self._thread = threading.Thread(target=self._spin, name="ros_spin", daemon=True)
        self._thread.start()

    def add_node(self, node: Node) -> Node:
        """Spin this node too; it is destroyed with the executor."""
        survive_clients(node)
        self._nodes.append(node)
        self._executor.add_node(node)
        return node

    def run(self, function: Callable[[], T], timeout: float = 60.0) -> T:
        """Call the function on the spinning thread and return what it returns. Raises TimeoutError
        where that thread does not take it up.
        """
        if threading.current_thread() is self._thread:
            return function()
        task = self._executor.create_task(function)
        if not self.wait(task, timeout):
            raise TimeoutError(f"the spinning thread did not take up the call within {timeout:g} s")
        result: T = task.result()
        return result

    def soon(self, function: Callable[[], object]) -> None:
        """Let the spinning thread call the function; nobody waits for it."""
        self._executor.create_task(function)

    def wait(self, future: Future, timeout: float, given_up: Cancellation | None = None) -> bool:
        """Wait until the future is done; False after `timeout` [s], or where it is given up."""
        ended = threading.Event()
        future.add_done_callback(lambda _: ended.set())
        deadline = time.monotonic() + timeout
        with (given_up or Cancellation()).calling(ended.set):
            # in slices, so that a failed callback ends the wait as well
            while not ended.wait(min(_SLICE, max(0.0, deadline - time.monotonic()))):
                self._raise_failure()
                if time.monotonic() >= deadline:
                    break
        return future.done()

    def wait_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until the condition holds; False after `timeout` [s]."""
        deadline = time.monotonic() + timeout
        while not condition():
            self._raise_failure()
            if time.monotonic() >= deadline:
                return False
            time.sleep(_POLL)
        return True

    def close(self) -> None:
        """Stop spinning and destroy the nodes; raises what a callback raised and nobody has heard
        of yet.
        """
        self._spinning.end()  # first, so that nobody spins what is taken apart
        self._thread.join(_LAST_CALLBACK)
        self._executor.shutdown(timeout_sec=5.0)
        for node in self._nodes:
            node.destroy_node()
        self._nodes.clear()
        self._raise_failure()

    def __enter__(self) -> BackgroundExecutor:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            failure = self._failure
            self._failure = None
            raise failure

    def _spin(self) -> None:
        while True:
            try:
                self._spinning.run(self._executor)
            except Exception as failure:  # of somebody's callback: it belongs to whoever waits
                self._failure = failure
            else:
                return


def _nothing() -> None:
    """A task that ends a wait."""
