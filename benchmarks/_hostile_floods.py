"""Presses of the emergency stop while the driver's node is flooded: how late, how many lost.

    python benchmarks/_hostile_floods.py levels     # one flood, until it is ended

A press by topic is timed until `~/stop_number` says so, one by service or Modbus until it is
answered.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from _hostile_node import PRESS, RELEASE, Prey, prey
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt64
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import PlcInputs
from ir_msgs.srv import QueryModes, SetPlcInput
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.topics import SERVICE
from ir_values.errors import IrError

LOST = 20.0  # s after which a press counts as lost
POINTS = 20_000
FLOODS = ("none", "levels", "requests", "trajectories", "goals")
AT_ONCE = 500  # requests of a flood under way
SETTLE = 10.0  # s after a flood in which memory has to return
_RELEASED = PlcInputs(move_enable=True)
_PRESSED = PlcInputs(move_enable=True, emergency_stop=True)

Way = Callable[[bool], None]


def flood(kind: str) -> None:
    """Send as fast as it goes, until the process is ended."""
    with Client(timeout=60.0) as client:
        send = {
            "levels": _levels,
            "requests": _requests,
            "trajectories": _trajectories,
            "goals": _goals,
        }[kind](client)
        while True:
            send()


def _levels(client: Client) -> Callable[[], None]:
    """Of the PLC's topic, none of them a press."""
    publisher = _publisher(client)
    return lambda: publisher.publish(_RELEASED)


def _requests(client: Client) -> Callable[[], None]:
    """Of a service, whose answers are not waited for."""
    node = client.node
    run = client._executor.run
    service = run(lambda: node.create_client(QueryModes, names.QUERY_MODES, qos_profile=SERVICE))
    client._executor.wait_until(service.service_is_ready, 60.0)
    request = QueryModes.Request()
    under_way: deque[Any] = deque()

    def send() -> None:
        under_way.append(service.call_async(request))
        if len(under_way) > AT_ONCE:
            service.remove_pending_request(under_way.popleft())

    return send


def _trajectories(client: Client) -> Callable[[], None]:
    """Long ones by topic."""
    publisher = _publisher(client, JointTrajectory, names.COMMANDED_TRAJECTORY)
    message = _long()
    return lambda: publisher.publish(message)


def _goals(client: Client) -> Callable[[], None]:
    """Long ones, each answered before the next."""
    goal = ExecuteTrajectory.Goal(trajectory=_long())

    def send() -> None:
        with suppress(IrError):  # what a flood gets
            client.send_goal(names.EXECUTE_TRAJECTORY, goal, None, 60.0)

    return send


def _long() -> JointTrajectory:
    points = [_point(k) for k in range(POINTS)]
    return JointTrajectory(joint_names=list(names.JOINT_NAMES), points=points)


def _point(k: int) -> Any:
    point = JointTrajectoryPoint(positions=[0.0] * 6, velocities=[0.0] * 6)
    point.time_from_start.sec, point.time_from_start.nanosec = divmod(k * 10_000_000, 10**9)
    return point


def _publisher(client: Client, kind: Any = PlcInputs, topic: str = names.PLC_INPUTS) -> Any:
    executor = client._executor
    quality = QoSProfile(depth=1000)
    made = executor.run(lambda: client.node.create_publisher(kind, topic, quality))
    executor.wait_until(lambda: made.get_subscription_count() > 0, 60.0)
    return made


@contextmanager
def flooded(kind: str, processes: int) -> Iterator[None]:
    """Processes that flood meanwhile."""
    command = [sys.executable, __file__, kind]
    running = [
        subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for _ in range(processes if kind != "none" else 0)
    ]
    try:
        time.sleep(5.0 if running else 0.0)
        yield
    finally:
        for each in running:
            each.send_signal(signal.SIGKILL)
            each.wait()


def floods(presses: int, processes: int = 2) -> Iterator[dict[str, Any]]:
    """Rows: latency of presses by each way under each flood [ms], and memory after it [MB]."""
    with prey() as driver:
        numbers: list[tuple[float, int]] = []
        driver.client.subscribe(
            names.STOP_NUMBER, UInt64, lambda msg: numbers.append((time.monotonic(), msg.data))
        )
        pressed: list[bool] = []
        driver.client.subscribe(
            names.PLC_INPUTS_IN_FORCE, PlcInputs, lambda msg: pressed.append(msg.emergency_stop)
        )
        for kind in FLOODS:
            before = driver.has()["rss_mb"]
            with flooded(kind, processes):
                for way, press in _ways(driver):
                    late, lost = _timed(press, numbers, pressed, presses, way != "topic")
                    yield _row(kind, way, late, lost)
            time.sleep(SETTLE)
            after = driver.has()["rss_mb"]
            yield {"case": "flood", "flood": kind, "rss_mb_before": before, "rss_mb_after": after}


def _row(kind: str, way: str, late: list[float], lost: int) -> dict[str, Any]:
    p50, p999 = (float(np.quantile(late, share)) * 1e3 for share in (0.5, 0.999))
    load = os.getloadavg()[0]
    found = {"case": "press", "flood": kind, "way": way, "cases": len(late) + lost, "lost": lost}
    return {**found, "p50_ms": p50, "p99.9_ms": p999, "load": load}


def _ways(driver: Prey) -> Iterator[tuple[str, Way]]:
    """How the button is pressed and let go."""
    publisher = _publisher(driver.client)

    def by_service() -> None:
        request = SetPlcInput.Request(name="emergency_stop", value=True)
        driver.client.call(names.SET_PLC_INPUT, request)

    yield "topic", lambda level: publisher.publish(_PRESSED if level else _RELEASED)
    yield "service", lambda level: by_service() if level else publisher.publish(_RELEASED)
    # opened now: the driver cuts a client that says nothing for a minute
    with socket.create_connection(("127.0.0.1", driver.port), timeout=60.0) as modbus:

        def by_modbus(level: bool) -> None:
            modbus.sendall(PRESS if level else RELEASE)
            modbus.recv(64)

        yield "modbus", by_modbus


def _timed(
    press: Way,
    numbers: list[tuple[float, int]],
    pressed: list[bool],
    count: int,
    answered: bool,
) -> tuple[list[float], int]:
    """Seconds until each press counts, and how many never did; each button is let go before."""
    late: list[float] = []
    lost = 0
    for _ in range(count):
        known = numbers[-1][1] if numbers else 0
        del pressed[:]
        began = time.monotonic()
        press(True)
        done = time.monotonic()
        while (not numbers or numbers[-1][1] == known) and time.monotonic() - began < LOST:
            time.sleep(0.0005)
        if not numbers or numbers[-1][1] == known:
            lost += 1
        else:
            late.append((done if answered else numbers[-1][0]) - began)
        press(False)
        let_go = time.monotonic()
        # pressed again while it still is pressed it would have no number
        while pressed[-1:] != [False] and time.monotonic() - let_go < LOST:
            time.sleep(0.005)
    return late or [LOST], lost


if __name__ == "__main__":
    flood(sys.argv[1])
