"""When a driver counts as silent: not while the process that listens was stopped itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

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
