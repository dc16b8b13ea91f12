"""Whatever is raised while a request is answered, it is answered, and the node lives on."""

from __future__ import annotations

import errno
import os
import resource
import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from ir_msgs.srv import SetLoad, SetPlcInput, StartPause
from ir_msgs_py.ros.node_process import FAILURES_MAX, Spinning, spin
from ir_msgs_py.status import StatusCode
from ir_sim_driver import Driver, make_simulation
from ir_sim_driver.node.services import DriverServices
from ir_sim_driver.notices import Level, Notice, Notices, shortened

NO_DESCRIPTORS = OSError(errno.EMFILE, "Too many open files")
FULL = OSError(errno.ENOSPC, "No space left on device")


@pytest.fixture
def driver() -> Any:
    made = Driver(make_simulation("open", backend="pybullet"))
    yield made
    made.close()


def services(driver: Any) -> DriverServices:
    return DriverServices(driver, "ir_sim_driver", lambda: None)


def test_a_bit_that_is_refused_is_answered_with_the_levels_as_they_are(driver: Driver) -> None:
    driver.press("service", "emergency_stop", True)
    release = SetPlcInput.Request(name="emergency_stop", value=False)
    waited = services(driver).set_plc_input(release, SetPlcInput.Response(), came_ns=1)
    assert waited.status.code == StatusCode.INVALID_ROBOT_STATE
    assert waited.inputs.emergency_stop
    assert waited.inputs.move_enable


@pytest.mark.parametrize(
    "error",
    [
        NO_DESCRIPTORS,
        FULL,
        MemoryError(),
        RecursionError(),
        OverflowError("1e308"),
        KeyError("\x1b[2J" * 5_000),
    ],
)
def test_whatever_is_raised_is_a_status(error: Exception) -> None:
    def fail(*arguments: object) -> None:
        raise error

    said: list[str] = []
    broken = SimpleNamespace(press=fail, start_pause=fail, warn=said.append)
    request = SetPlcInput.Request(name="ab")
    response = SetPlcInput.Response()
    status = services(broken).set_plc_input(request, response).status
    assert status.code == StatusCode.FAILURE
    assert type(error).__name__ in status.message
    assert status.message.isprintable()
    assert len(status.message) < 5_000
    assert "Traceback" in said[0]


@pytest.mark.parametrize("field", ["mass", "watts_always", "watts_drive_bus"])
@pytest.mark.parametrize("value", [1e308, -1e308, float("nan"), float("inf"), 5e-324])
def test_extreme_numbers_of_a_load_are_answered(driver: Driver, field: str, value: float) -> None:
    request = SetLoad.Request(load="custom", mass=10.0, inertia=[0.1, 0.0, 0.0, 0.1, 0.0, 0.1])
    setattr(request, field, value)
    response = services(driver).set_load(request, SetLoad.Response())
    assert response.status.message
    goes_on(driver)


@pytest.mark.parametrize("value", [1e308, -1e308, float("nan"), float("inf"), 5e-324])
def test_extreme_pauses_are_answered(driver: Driver, value: float) -> None:
    response = services(driver).start_pause(StartPause.Request(pause=value), StartPause.Response())
    assert response.status.message
    goes_on(driver)


def goes_on(driver: Driver) -> None:
    for k in range(1, 20):
        frame = driver.tick(k * 2_000_000)
    assert frame.joints.q is not None
    assert np.isfinite(frame.joints.q).all()
    assert not driver._simulation.stopped


def without_descriptors(work: Callable[[], Any]) -> Any:
    """Do it while this process may open nothing more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    lowest = os.dup(0)
    os.close(lowest)
    resource.setrlimit(resource.RLIMIT_NOFILE, (lowest, hard))
    try:
        return work()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_without_descriptors_a_load_is_refused_and_the_robot_carries_what_it_did(
    driver: Driver,
) -> None:
    before = driver._simulation.load
    request = SetLoad.Request(load="custom", mass=10.0, inertia=[0.1, 0.0, 0.0, 0.1, 0.0, 0.1])
    answers = services(driver)
    response = without_descriptors(lambda: answers.set_load(request, SetLoad.Response()))
    assert response.status.code == StatusCode.FAILURE
    assert "PyBullet" in response.status.message
    assert driver._simulation.load is before
    goes_on(driver)
    assert answers.set_load(request, SetLoad.Response()).status.code == StatusCode.SUCCESS
    goes_on(driver)


def test_a_robot_needs_no_temporary_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **more: object) -> None:
        raise FULL

    for name in ("mkstemp", "mkdtemp", "NamedTemporaryFile", "TemporaryDirectory"):
        monkeypatch.setattr(f"tempfile.{name}", refuse)
    simulation = make_simulation("open", backend="pybullet")
    simulation.run(0.1)
    assert not simulation.stopped


def test_a_callback_that_fails_does_not_end_the_node(ros_context: Any, ros_node: Node) -> None:
    executor = SingleThreadedExecutor(context=ros_context)
    spinning = Spinning()
    other = Node("victim", context=ros_context)
    executor.add_node(other)
    calls: list[int] = []

    def fail() -> None:
        calls.append(len(calls))
        if len(calls) == 3:
            spinning.end()
        raise NO_DESCRIPTORS

    other.create_timer(0.001, fail)
    thread = threading.Thread(target=lambda: spin(spinning, executor, other, None))
    thread.start()
    thread.join(60.0)
    assert not thread.is_alive()
    assert len(calls) >= 3
    executor.shutdown()
    other.destroy_node()


def test_a_node_that_does_nothing_but_fail_ends(ros_context: Any) -> None:
    executor = SingleThreadedExecutor(context=ros_context)
    other = Node("victim", context=ros_context)
    executor.add_node(other)
    calls: list[int] = []

    def fail() -> None:
        calls.append(1)
        raise NO_DESCRIPTORS

    other.create_timer(0.001, fail)
    with pytest.raises(OSError, match="Too many open files"):
        spin(Spinning(), executor, other, None)
    assert len(calls) == FAILURES_MAX + 1
    executor.shutdown()
    other.destroy_node()


def test_what_is_logged_is_bounded_and_errors_stay() -> None:
    notices = Notices()
    for k in range(100):
        notices.add(Level.OK, f"line {k}\x1b[2J" + "x" * 10_000)
    notices.add(Level.ERROR, "the plant has stopped")
    lines = shortened(notices.take(), 20)
    assert len(lines) == 20
    assert lines[-2] == Notice(Level.ERROR, "the plant has stopped")
    assert lines[-1].sentence == "and 82 more messages"
    assert all(line.sentence.isprintable() and len(line.sentence) < 5_000 for line in lines)
    assert shortened(lines, 20) == lines
