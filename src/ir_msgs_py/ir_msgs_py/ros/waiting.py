"""Waiting in a callback without blocking it: `await waiting.until(condition, timeout)`.

For coroutines on a SingleThreadedExecutor. A condition is looked at whenever something arrives
(`look`) and at least every `period`; time is the steady clock, so a jump of /clock neither ends nor
prolongs a wait. A process that was held up gets that time again: what came meanwhile is not late.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from ir_msgs_py.status import Status, StatusCode

_HELD_UP = 0.1
"""s between two looks from which on a process was held up."""


@dataclass(eq=False)
class _Wait:
    condition: Callable[[], bool]
    deadline: float
    future: Future = field(default_factory=Future)


class Waiting:
    """Waits of one node's coroutines; the timer runs only while somebody waits."""

    def __init__(self, node: Node, period: float = 0.02) -> None:
        self._waits: list[_Wait] = []
        self._looked = 0.0
        self._timer = node.create_timer(
            period, self.look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._timer.cancel()

    async def until(self, condition: Callable[[], bool], timeout: float = float("inf")) -> bool:
        """Wait until the condition holds; False when `timeout` [s] went by first."""
        if condition():
            return True
        now = time.monotonic()
        self._give_back(now)
        wait = _Wait(condition, now + timeout)
        self._waits.append(wait)
        self._timer.reset()
        return bool(await wait.future)

    async def answer(
        self, future: Future, timeout: float, over: Callable[[], bool] = lambda: False
    ) -> bool:
        """Wait for a service's or action's future, or until it is `over`; False when neither is so
        within `timeout` [s].
        """
        future.add_done_callback(lambda done: self.look())
        return await self.until(lambda: future.done() or over(), timeout)

    async def ask(self, client: Any, request: Any, timeout: float) -> Any:
        """Call a service: its response, or a TIMED_OUT Status when there is none in `timeout`
        [s].
        """
        if not await self.until(client.service_is_ready, timeout):
            return Status(
                StatusCode.TIMED_OUT, f"no node offers {client.service_name} within {timeout:g} s"
            )
        future: Future = client.call_async(request)
        if not await self.answer(future, timeout):
            client.remove_pending_request(future)
            return Status(
                StatusCode.TIMED_OUT, f"{client.service_name} did not answer within {timeout:g} s"
            )
        return future.result()

    def look(self) -> None:
        """Look at all conditions again; call it where something arrives that a condition depends
        on.
        """
        now = time.monotonic()
        self._give_back(now)
        for wait in list(self._waits):
            met = wait.condition()
            if met or now >= wait.deadline:
                self._waits.remove(wait)
                wait.future.set_result(met)
        if not self._waits:
            self._timer.cancel()

    def _give_back(self, now: float) -> None:
        """Prolong all waits by the time in which nobody looked."""
        lost = now - self._looked - _HELD_UP
        self._looked = now
        for wait in self._waits:
            wait.deadline += max(0.0, lost)
