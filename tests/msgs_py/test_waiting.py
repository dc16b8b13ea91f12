"""Waits in callbacks: as long as was asked for, in time in which this process could look."""

from __future__ import annotations

from collections.abc import Coroutine
from types import SimpleNamespace
from typing import Any

import pytest

from ir_msgs_py.ros import waiting
from ir_msgs_py.ros.waiting import Waiting

PERIOD = 0.02


class Waits:
    """Waits whose time passes as the test says."""

    def __init__(self, node: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.met = False
        self.ended = list[bool]()
        monkeypatch.setattr(waiting, "time", SimpleNamespace(monotonic=lambda: self.now))
        node = SimpleNamespace(
            create_timer=lambda *_, **__: SimpleNamespace(cancel=_nothing, reset=_nothing)
        )
        self.waiting = Waiting(node, PERIOD)
        self._coroutine: Coroutine[Any, Any, bool] | None = None

    def begin(self, timeout: float) -> None:
        self._coroutine = self.waiting.until(lambda: self.met, timeout)
        self._go_on()

    def live(self, seconds: float) -> None:
        """Look every PERIOD."""
        for _ in range(round(seconds / PERIOD)):
            self.held_up(PERIOD)

    def held_up(self, seconds: float) -> None:
        """Look after this time only."""
        self.now += seconds
        self.waiting.look()
        self._go_on()

    def _go_on(self) -> None:
        try:
            if self._coroutine is not None:
                self._coroutine.send(None)
        except StopIteration as end:
            self.ended.append(end.value)
            self._coroutine = None


def _nothing() -> None:
    """Of a timer that is none."""


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> Waits:
    return Waits(None, monkeypatch)


def test_a_wait_ends_when_its_time_is_over(waits: Waits) -> None:
    waits.begin(2.0)
    waits.live(1.96)
    assert waits.ended == []
    waits.live(0.1)
    assert waits.ended == [False]


def test_what_came_while_the_process_was_held_up_is_not_late(waits: Waits) -> None:
    """The timer is called first, and what waits in the middleware after it."""
    waits.begin(2.0)
    waits.live(1.0)
    waits.held_up(3.0)
    assert waits.ended == []
    waits.met = True
    waits.held_up(0.0)
    assert waits.ended == [True]


def test_a_process_that_was_held_up_still_loses_its_patience(waits: Waits) -> None:
    waits.begin(2.0)
    waits.live(1.0)
    waits.held_up(60.0)
    waits.live(0.8)
    assert waits.ended == []
    waits.live(0.2)
    assert waits.ended == [False]


def test_a_wait_that_begins_after_a_long_rest_has_its_own_time(waits: Waits) -> None:
    waits.begin(1.0)
    waits.live(1.1)
    waits.now += 1000.0
    waits.begin(1.0)
    waits.live(1.1)
    assert waits.ended == [False, False]
