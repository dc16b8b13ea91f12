"""The driver's node as a process under attack: what it answers, and what memory, descriptors and
threads it has afterwards.
"""

from __future__ import annotations

import os
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from _node_process import running
from rclpy.action import ActionClient
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import CellState, ControllerState, PlcInputs, PowerState
from ir_msgs.srv import EndPause, QueryModes, Recover, SetLoad, SetPlcInput, StartPause
from ir_msgs_py import names
from ir_msgs_py.modes import Mode
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.topics import ACTION_SERVICES, LATCHED, SERVICE
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.plc.modbus import COILS

AT_ONCE = 50  # requests under way
GIVEN_UP = 15.0  # s after its death in which a client is forgotten, on a busy machine
ANSWERED = 60.0  # s, for a lump of requests
PRESS = struct.pack(">HHHBBHH", 1, 0, 6, 1, 5, COILS.index("emergency_stop"), 0xFF00)
RELEASE = PRESS[:-2] + b"\0\0"
SERVICES: tuple[tuple[str, Any], ...] = (
    (names.QUERY_MODES, QueryModes.Request()),
    (names.SET_PLC_INPUT, SetPlcInput.Request(name="move_enable", value=True)),
    (names.SET_LOAD, SetLoad.Request(load="none")),
    (names.START_PAUSE, StartPause.Request(pause=-1.0)),
    (names.END_PAUSE, EndPause.Request()),
    (names.RECOVER, Recover.Request()),
)


@dataclass
class Prey:
    """A driver's process, and a client of it. modes: of its last messages; logs: where it
    writes.
    """

    pid: int
    port: int
    client: Client
    modes: list[int]
    logs: Path

    def has(self) -> dict[str, float]:
        """Memory [MB], descriptors, threads, and log [kB]."""
        status = Path(f"/proc/{self.pid}/status").read_text().splitlines()
        fields = dict(line.split(":", 1) for line in status)
        return {
            "rss_mb": int(fields["VmRSS"].split()[0]) / 1024.0,
            "descriptors": len(os.listdir(f"/proc/{self.pid}/fd")),
            "threads": int(fields["Threads"]),
            "log_kb": sum(each.stat().st_size for each in self.logs.rglob("*") if each.is_file())
            / 1024.0,
        }


@contextmanager
def prey(*, watched: bool = True, **parameters: str | int) -> Iterator[Prey]:
    """A driver with the ideal robot, short transitions and Modbus; parameters: more of it.
    watched: whether `modes` are heard.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    more: dict[str, str | int] = {
        "plc.startup_window": "0.0",
        "transitions.stand_on_brakes_leave": "0.01",
    }
    more |= parameters
    with tempfile.TemporaryDirectory() as logs:
        os.environ["ROS_LOG_DIR"] = logs
        set_logger_level(
            "ir_client", LoggingSeverity.ERROR
        )  # not every subscription fits a plain publisher
        given: dict[str, str | int] = {"cell": "open", "backend": "ideal", "wake_port": 0, **more}
        with (
            running("ir_sim_driver.node", modbus="true", modbus_port=port, **given) as process,
            Client(timeout=ANSWERED) as client,
        ):
            modes: list[int] = []
            client.next_message(names.POWER_STATE, PowerState)
            if watched:
                client.subscribe(names.POWER_STATE, PowerState, lambda msg: modes.append(msg.mode))
            yield Prey(process.pid, port, client, modes, Path(logs))


def attack(calls: int, presses: int) -> list[dict[str, Any]]:
    """Rows of a table: what was done, what is lost, and what the process has before and after."""
    huge, small = (partial(goals, points=points) for points in (100_000, 2))
    with prey() as driver:
        works = [
            *(
                (f"calls of {name.rpartition('/')[2]}", calls, partial(call, name, what))
                for name, what in SERVICES
            ),
            ("goals of 100,000 points", max(2, calls // 500), huge),
            ("goals of 2 points", calls // 10, small),
            ("silent Modbus clients", 1_000, silent),
            *(
                (f"presses amid {rate} Hz", presses, partial(press_all, rate))
                for rate in (20, 100, 250)
            ),
        ]
        return [_row(driver, *work) for work in works]


def killed_row(clients: int) -> dict[str, Any]:
    """Clients that are killed with goals that wait, and how many of these moved the robot after
    the middleware has given their client up.
    """
    went_on = 0
    with prey() as driver:
        speeds: list[float] = []
        driver.client.subscribe(
            names.JOINT_STATES,
            JointState,
            lambda msg: speeds.append(float(np.abs(msg.velocity).max())),
        )
        for _ in range(clients):
            with subprocess.Popen([sys.executable, __file__]) as client:
                driver.client._executor.wait_until(lambda: speeds[-1:] > [1e-3], ANSWERED)
                time.sleep(1.0)
                client.kill()
            time.sleep(GIVEN_UP)
            del speeds[:]
            driver.client._executor.wait_until(lambda: len(speeds) > 1000, ANSWERED)
            went_on += max(speeds) > 1e-3
    return {"case": "killed clients", "cases": clients, "went_on": went_on}


def send_and_wait() -> None:
    """Goals there and back, 31 of them, by a client that ends only when it is killed."""
    with Client(timeout=ANSWERED) as client:
        q = client.next_message(names.CONTROLLER_STATE, ControllerState).reference.positions
        node = client.node
        run = client._executor.run
        action = run(
            lambda: ActionClient(
                node, ExecuteTrajectory, names.EXECUTE_TRAJECTORY, **ACTION_SERVICES
            )
        )
        client._executor.wait_until(action.server_is_ready, ANSWERED)
        start = np.array(q)
        for k in range(31):
            target = start + (0.0 if k % 2 else 0.3) * np.eye(6)[0]
            path = JointTrajectory.from_seconds(
                names.JOINT_NAMES, [60.0], target[None], np.zeros((1, 6))
            )
            goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(path))
            run(lambda goal=goal: action.send_goal_async(goal))
        time.sleep(600.0)


def cells_row() -> dict[str, Any]:
    """Cells that no driver can take, and how many of them ended it."""
    texts = ("", "{", "1", "name: x", "name: x\nrobot: {name: kr210}", "a: " + "[" * 10_000)
    ended = 0
    with prey() as driver:
        node = driver.client.node
        run = driver.client._executor.run
        publisher = run(lambda: node.create_publisher(CellState, names.CELL, LATCHED))
        driver.client._executor.wait_until(lambda: publisher.get_subscription_count() > 0, ANSWERED)
        for text in texts:
            run(lambda text=text: publisher.publish(CellState(name="x", cell_yaml=text)))
            del driver.modes[:]
            heard = driver.client._executor.wait_until(lambda: len(driver.modes) > 100, ANSWERED)
            ended += not heard or call(names.QUERY_MODES, QueryModes.Request(), driver, 1) > 0
    return {"case": "cells", "cases": len(texts), "ended": ended}


def _row(driver: Prey, what: str, count: int, act: Callable[[Prey, int], int]) -> dict[str, Any]:
    act(driver, max(1, count // 10))  # caches fill
    before = driver.has()
    began = time.monotonic()
    lost = act(driver, count)
    seconds = time.monotonic() - began
    after = driver.has()
    table = {f"{key}_before": value for key, value in before.items()}
    table |= {f"{key}_after": value for key, value in after.items()}
    return {"case": "node", "what": what, "cases": count, "lost": lost, "s": seconds, **table}


def call(service: str, request: Any, driver: Prey, count: int) -> int:
    """Call a service so often, several at once; how many calls were not answered."""
    node = driver.client.node
    executor = driver.client._executor
    client = executor.run(
        lambda: node.create_client(type_of(request), service, qos_profile=SERVICE)
    )
    answered = 0
    executor.wait_until(client.service_is_ready, ANSWERED)
    for _ in range(0, count, AT_ONCE):
        lump = executor.run(lambda: [client.call_async(request) for _ in range(AT_ONCE)])
        executor.wait_until(lambda lump=lump: all(future.done() for future in lump), ANSWERED)
        answered += sum(future.done() for future in lump)
    executor.run(lambda: node.destroy_client(client))
    return -(-count // AT_ONCE) * AT_ONCE - answered


def type_of(request: Any) -> Any:
    """The service of a request."""
    known = (QueryModes, SetPlcInput, SetLoad, StartPause, EndPause, Recover)
    return next(kind for kind in known if isinstance(request, kind.Request))


def goals(driver: Prey, count: int, points: int) -> int:
    """Send movements that go nowhere, longer than is taken, or short; how many had no result."""
    q = np.array(
        driver.client.next_message(names.CONTROLLER_STATE, ControllerState).reference.positions
    )
    times = 0.1 + np.arange(points) * 0.03
    rest = np.zeros((points, 6))
    path = JointTrajectory.from_seconds(
        names.JOINT_NAMES, times, np.tile(q, (points, 1)), rest, rest
    )
    goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(path))
    lost = 0
    for _ in range(count):
        try:
            driver.client.send_goal(names.EXECUTE_TRAJECTORY, goal, timeout=ANSWERED)
        except Exception:  # whatever it was: there is no result
            lost += 1
    return lost


def silent(driver: Prey, count: int) -> int:
    """Connect so many silent clients; 1 when nobody else is served then."""
    before = driver.has()["descriptors"]
    links = [
        socket.create_connection(("127.0.0.1", driver.port), timeout=10.0) for _ in range(count)
    ]
    served = False
    for _ in range(100):
        try:
            served = _written(driver, (PRESS[:7] + struct.pack(">BHH", 1, 0, 9),))
        except OSError:
            time.sleep(0.1)
        if served:
            break
    for link in links:
        link.close()
    driver.client._executor.wait_until(lambda: driver.has()["descriptors"] <= before, 5.0)
    return 0 if served else 1


def press_all(rate: int, driver: Prey, count: int) -> int:
    """Presses by service, topic and Modbus while a PLC publishes zeros; how many were not
    latched.
    """
    node = driver.client.node
    executor = driver.client._executor
    quality = QoSProfile(depth=1000)
    topic = executor.run(lambda: node.create_publisher(PlcInputs, names.PLC_INPUTS, quality))
    executor.wait_until(lambda: topic.get_subscription_count() > 0, ANSWERED)
    ended = threading.Event()
    quiet = PlcInputs(move_enable=True)

    def traffic() -> None:
        while not ended.wait(1.0 / rate):
            topic.publish(quiet)

    plc = threading.Thread(target=traffic)
    plc.start()
    generator = np.random.default_rng(rate)
    lost = 0
    try:
        for k in range(count):
            time.sleep(float(generator.uniform(0.0, 2.0 / rate)))
            if k % 3 == 0:
                request = SetPlcInput.Request(name="emergency_stop", value=True)
                driver.client.call(names.SET_PLC_INPUT, request)
            elif k % 3 == 1:
                topic.publish(PlcInputs(emergency_stop=True, move_enable=True))
                topic.publish(quiet)
            else:
                _written(driver, (PRESS, RELEASE))
            lost += not _latched(driver)
            _recover(driver)
    finally:
        ended.set()
        plc.join()
        executor.run(lambda: node.destroy_publisher(topic))
    return lost


def _written(driver: Prey, requests: Sequence[bytes]) -> bool:
    """Whether every Modbus request was answered without an exception."""
    with socket.create_connection(("127.0.0.1", driver.port), timeout=10.0) as link:
        for request in requests:
            link.sendall(request)
            answer = link.recv(64)
            if len(answer) < 9 or answer[7] & 0x80:
                return False
    return True


def _latched(driver: Prey) -> bool:
    """Whether the stop shows and stays; however late, on a loaded machine."""
    executor = driver.client._executor
    modes = driver.modes
    executor.wait_until(lambda: bool(modes) and modes[-1] == Mode.EMERGENCY_STOP, ANSWERED)
    del modes[:]
    executor.wait_until(lambda: len(modes) >= 5, ANSWERED)
    return set(modes) == {int(Mode.EMERGENCY_STOP)}


def _recover(driver: Prey) -> None:
    executor = driver.client._executor
    modes = driver.modes

    def stands() -> bool:
        return bool(modes) and modes[-1] == Mode.STAND_ON_MOTORS

    for _ in range(50):
        driver.client.call(names.RECOVER, Recover.Request())
        if executor.wait_until(stands, 0.2):
            return


if __name__ == "__main__":
    send_and_wait()
