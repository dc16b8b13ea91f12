"""Waiting for the mains meter: it counts its own time, since on a busy machine it lags behind the
clock.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from ir_cli.errors import CommandError
from ir_cli.ros.power_tour import PowerWatch, stand_on_motors
from ir_msgs.msg import PowerMode, PowerState
from ir_msgs_py.ros.client import Client

NOW = 1000.0  # s on the node's clock, which stands: whatever the meter says, it is behind
PATIENCE = 1.0  # s
EVERY = 0.01  # s of real time


class FakeMeter:
    """A client of a meter whose readings are `step` s apart on its own clock, and `EVERY` s of real
    time.
    """

    def __init__(self, behind: float, step: float) -> None:
        self.mode = PowerMode.STAND_ON_BRAKES
        now = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(NOW * 1e9)))
        self.node = SimpleNamespace(get_clock=lambda: now)
        self._stamp = NOW - behind
        self._step = step
        self._take: Callable[[PowerState], None] = lambda state: None
        self.passed = 0.0

    def subscribe(self, topic: str, kind: type, take: Callable[[PowerState], None]) -> None:
        self._take = take

    def read(self) -> None:
        """The next reading."""
        self.passed += EVERY
        self._stamp += self._step
        state = PowerState(mode=self.mode)
        state.header.stamp.sec = int(self._stamp)
        state.header.stamp.nanosec = int(self._stamp % 1.0 * 1e9)
        self._take(state)


class Turns(threading.Condition):
    """Who waits gets the next reading of the meter, without a clock that could be slow."""

    def __init__(self, meter: FakeMeter) -> None:
        super().__init__()
        self._meter = meter

    def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
        self._meter.read()
        return predicate()


def watch(meter: FakeMeter) -> PowerWatch:
    return PowerWatch(cast(Client, cast(Any, meter)), PATIENCE)


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Callable[[FakeMeter], PowerWatch]:
    """Watches a meter that goes on, in real time that passes with its readings."""

    def made(meter: FakeMeter) -> PowerWatch:
        found = watch(meter)
        monkeypatch.setattr(found, "_changed", Turns(meter))
        monkeypatch.setattr(time, "monotonic", lambda: meter.passed)
        return found

    return made


def test_a_plant_that_lags_behind_rests_on_its_own_clock(
    watched: Callable[[FakeMeter], PowerWatch],
) -> None:
    """Once the meter had to reach the node's clock before it counted."""
    meter = FakeMeter(behind=500.0, step=0.02)
    assert watched(meter).stays(PowerMode.STAND_ON_BRAKES, 0.1)
    assert meter.passed == pytest.approx(6 * EVERY)


def test_a_mode_that_does_not_come_is_waited_for_by_the_meter_s_time(
    watched: Callable[[FakeMeter], PowerWatch],
) -> None:
    waiting = watched(FakeMeter(behind=1.0, step=0.5))
    with pytest.raises(CommandError, match="waited 1 s for power mode"):
        waiting.wait_for_mode(PowerMode.HIBERNATION)


def test_a_mode_that_the_controller_leaves_by_itself_has_not_stayed(
    watched: Callable[[FakeMeter], PowerWatch],
) -> None:
    meter = FakeMeter(behind=0.0, step=0.01)
    assert not watched(meter).stays(PowerMode.STAND_ON_MOTORS, 60.0)
    assert meter.passed < PATIENCE


def test_a_silent_meter_is_said_to_say_nothing() -> None:
    with pytest.raises(CommandError, match="the mains meter says nothing"):
        watch(FakeMeter(behind=0.0, step=0.1)).stays(PowerMode.STAND_ON_BRAKES, 0.1)


class ClosingMeter(FakeMeter):
    """Of a controller whose timer closes the brakes a few readings after they were released."""

    _left = 0

    def ask(self, *_: object) -> SimpleNamespace:
        self.mode = PowerMode.STAND_ON_MOTORS
        self._left = 5
        return SimpleNamespace(inputs=None)

    def read(self) -> None:
        self._left -= 1
        if self._left < 0:
            self.mode = PowerMode.STAND_ON_BRAKES
        super().read()


@pytest.mark.parametrize("behind", [0.0, 500.0])
def test_brakes_that_close_before_the_robot_has_stood_end_the_tour(
    behind: float, watched: Callable[[FakeMeter], PowerWatch]
) -> None:
    """Once the tour went on for ever."""
    meter = ClosingMeter(behind=behind, step=0.01)
    with pytest.raises(CommandError, match=r"closed its brakes 5 times before .* 0.1 s on motors"):
        stand_on_motors(cast(Client, cast(Any, meter)), watched(meter), 0.1)


def test_a_plant_that_lags_further_than_the_brakes_stay_open_stands_on_motors(
    watched: Callable[[FakeMeter], PowerWatch],
) -> None:
    meter = ClosingMeter(behind=500.0, step=0.03)
    stand_on_motors(cast(Client, cast(Any, meter)), watched(meter), 0.1)
