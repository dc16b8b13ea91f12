"""When a driver counts as silent: not while the process that listens was stopped itself; and the
time of a plant that lags.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs.msg import PowerState
from ir_msgs_py.ros import node_clients
from ir_msgs_py.ros.topics import Received
from ir_msgs_py.ros.waiting import Waiting


class Link:
    """A driver link whose time and meter the test has."""

    def __init__(self, node: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.reading = False
        monkeypatch.setattr(node_clients, "time", SimpleNamespace(monotonic=lambda: self.now))
        self.driver = node_clients.DriverClient(
            node, Waiting(node), "ir_sim_driver", silence_timeout=2.0
        )
        meter = SimpleNamespace(take=lambda: Received(PowerState(), 0.0) if self.reading else None)
        monkeypatch.setattr(self.driver, "_meter", meter)

    def silent_after(self, seconds: float) -> bool:
        self.now += seconds
        return self.driver.silent


@pytest.fixture
def link(ros_node: Any, ros_executor: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    return ros_executor.run(lambda: Link(ros_node, monkeypatch))


def test_a_driver_that_was_never_heard_is_silent(link: Link) -> None:
    assert [link.silent_after(seconds) for seconds in (0.0, 1.0, 5.0)] == [True, True, True]


def test_a_driver_falls_silent_when_nothing_comes_for_the_timeout(link: Link) -> None:
    link.reading = True
    assert not link.silent_after(0.0)
    link.reading = False
    assert [link.silent_after(0.5) for _ in range(5)] == [False, False, False, False, True]


@pytest.mark.parametrize("stopped", [1.9, 60.0])
def test_a_process_that_was_stopped_takes_nobody_for_silent_at_once(
    link: Link, stopped: float
) -> None:
    """Nor when that took a little less than the timeout: the meter is heard a moment later."""
    link.reading = True
    assert not link.silent_after(0.0)
    link.reading = False
    assert not link.silent_after(stopped)
    assert [link.silent_after(0.5) for _ in range(5)] == [False, False, False, False, True]


NS = 1_000_000_000
PERIODS = st.lists(
    st.tuples(st.floats(1e-3, 5.0), st.floats(0.0, 2.0), st.floats(0.0, 1.0)), min_size=1
)


class Listened:
    """A plant at any speed, whose readings come late, heard on a steady clock."""

    def __init__(self) -> None:
        self.now = 50.0
        self.stamp = 1_700_000_000 * NS
        self.time = node_clients.PlantTime(lambda: self.now)
        self.time.hear(self.stamp, 0.0)

    def hear(self, seconds: float, speed: float, late: float, jump: float = 0.0) -> float:
        """The next reading after so long, with stamps that have jumped; the plant's seconds."""
        self.now += seconds
        passed = round(seconds * speed * NS)
        self.stamp += passed + round(jump * NS)
        self.time.hear(self.stamp, late * min(seconds, 1.0))
        return passed / NS


@given(PERIODS)
def test_time_of_a_plant_that_lags_and_makes_up_for_it_is_that_of_its_stamps(
    periods: list[tuple[float, float, float]],
) -> None:
    plant = Listened()
    passed = sum(plant.hear(*period) for period in periods)
    assert plant.time() == pytest.approx(passed, abs=1e-6)
    assert plant.time.stamp_ns == plant.stamp


@given(PERIODS, st.floats(0.1, 1e6).map(lambda s: -s) | st.floats(20.0, 1e6), st.integers(0))
def test_a_clock_that_is_set_costs_no_more_than_one_reading(
    periods: list[tuple[float, float, float]], jump: float, place: int
) -> None:
    plant = Listened()
    k = place % len(periods)
    passed = sum(
        plant.hear(*period, jump if number == k else 0.0) for number, period in enumerate(periods)
    )
    assert abs(plant.time() - passed) <= 2.0 * periods[k][0] + 1.0 + 1e-6


def test_readings_without_a_stamp_count_when_they_come() -> None:
    plant = Listened()
    plant.stamp = 0
    for _ in range(10):
        plant.hear(0.5, 0.0, 0.0)
    assert plant.time() == pytest.approx(5.0)
