"""Waiting for the mains meter: it counts its own time, since on a busy machine it lags behind the clock."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, cast

import pytest

from ir_cli.demo.power_tour import PowerWatch
from ir_cli.errors import DemonstrationError
from ir_msgs.msg import PowerMode, PowerState
from ir_msgs_py.ros.client import Client

NOW = 1000.0  # s on the node's clock, which stands: whatever the meter says, it is behind
PATIENCE = 1.0  # s


class FakeMeter:
    """A client of a meter whose readings are `step` s apart on its own clock, one every `every` s."""

    def __init__(self, behind: float, step: float, every: float = 0.01) -> None:
        now = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(NOW * 1e9)))
        self.node = SimpleNamespace(get_clock=lambda: now)
        self._stamp, self._step, self._every = NOW - behind, step, every
        self._take: Callable[[PowerState], None] = lambda state: None
        self._end = threading.Event()

    def subscribe(self, topic: str, kind: type, take: Callable[[PowerState], None]) -> None:
        self._take = take

    @contextmanager
    def running(self) -> Iterator[None]:
        thread = threading.Thread(target=self._run)
        thread.start()
        try:
            yield
        finally:
            self._end.set()
            thread.join()

    def _run(self) -> None:
        while not self._end.wait(self._every):
            self._stamp += self._step
            state = PowerState(mode=PowerMode.STAND_ON_BRAKES)
            state.header.stamp.sec = int(self._stamp)
            state.header.stamp.nanosec = int(self._stamp % 1.0 * 1e9)
            self._take(state)


def watch(meter: FakeMeter) -> PowerWatch:
    return PowerWatch(cast(Client, cast(Any, meter)), PATIENCE)


def test_a_meter_that_lags_behind_is_waited_for_as_long_as_it_goes_on() -> None:
    meter = FakeMeter(behind=3.0, step=0.02)
    waiting = watch(meter)
    with meter.running():
        began = time.monotonic()
        waiting.stay(0.1)
    assert time.monotonic() - began > PATIENCE  # 155 readings, 10 ms apart


def test_a_mode_that_does_not_come_is_waited_for_by_the_meter_s_time() -> None:
    meter = FakeMeter(behind=1.0, step=0.5)
    waiting = watch(meter)
    waited = "waited 1 s for power mode"
    with meter.running(), pytest.raises(DemonstrationError, match=waited):
        waiting.wait_for_mode(PowerMode.HIBERNATION)


def test_a_silent_meter_is_said_to_say_nothing() -> None:
    with pytest.raises(DemonstrationError, match="the mains meter says nothing"):
        watch(FakeMeter(behind=0.0, step=0.1)).stay(0.1)
