"""`ir view --live` and a real driver: what it says reaches a browser, a browser's buttons reach its
PLC.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from typing import Any

import pytest
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState

from ir_description import cell_to_yaml, load_cell
from ir_msgs.msg import CellState, Contact, MachineStates, PowerState, ProgramState
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_recorder.live import server as commands
from ir_recorder.live.node import LiveNode
from ir_sim_driver.node import SimDriver

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
EVIL = "</script><img src=x onerror=alert(1)>\n\n"


class Browser:
    """Reads the events of a live view in a thread: all values now, and the records that came."""

    def __init__(self, port: int, token: str) -> None:
        self._port = port
        self._token = token
        self.state: dict[str, Any] = {}
        self.records: list[dict[str, Any]] = []
        connection = HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
        connection.request("GET", "/events")
        self._answer = connection.getresponse()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        while line := self._answer.readline():
            key, _, value = line.decode().rstrip("\n").partition(": ")
            if key == "data":
                content = json.loads(value)
                start = isinstance(content, dict)
                records = content["records"] if start else content
                for record in [content["before"], *records] if start else records:
                    self.state.update(record)
                    self.records.append(record)

    def press(self, name: str, level: bool, stop: str | None = None) -> dict[str, Any]:
        seen = self.state.get("stop", "") if stop is None else stop
        value = {"level": level, "stop": seen} if seen else level
        connection = HTTPConnection("127.0.0.1", self._port, timeout=PATIENCE)
        headers = {"X-Live-Token": self._token, "Content-Type": "application/json"}
        connection.request("POST", "/press", json.dumps({"name": name, "value": value}), headers)
        answer: dict[str, Any] = json.loads(connection.getresponse().read())
        return answer

    def scene(self) -> Any:
        connection = HTTPConnection("127.0.0.1", self._port, timeout=PATIENCE)
        connection.request("GET", "/scene")
        return json.loads(connection.getresponse().read())


@pytest.fixture
def live(ros_context: Any, ros_executor: Any, monkeypatch: pytest.MonkeyPatch) -> LiveNode:
    monkeypatch.setattr(commands, "PATIENCE", 60.0)  # s: a busy machine
    node: LiveNode = ros_executor.add_node(LiveNode(context=ros_context))
    return node


@pytest.fixture
def browser(live: LiveNode) -> Browser:
    return Browser(live.server.port, live.server.guard.token)


@contextmanager
def a_driver(context: Any) -> Iterator[None]:
    """A driver that spins, and is gone afterwards."""
    values = {"cell": "demo", "backend": "ideal", "wake_port": 0, "plc.startup_window": 0.0}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    with BackgroundExecutor(context) as executor:
        executor.add_node(SimDriver(context=context, parameter_overrides=overrides))
        yield


@pytest.fixture
def publish(ros_node: Any, ros_executor: Any) -> Callable[[str, Any], None]:
    made: dict[str, Any] = {}

    def send(topic: str, message: Any) -> None:
        if topic not in made:
            kind = type(message)
            made[topic] = ros_executor.run(lambda: ros_node.create_publisher(kind, topic, LATCHED))
        ros_executor.run(lambda: made[topic].publish(message))

    return send


def test_a_driver_is_seen_obeys_the_buttons_and_may_go_and_come(
    browser: Browser, ros_context: Any, publish: Any, wait_for: Any
) -> None:
    state = browser.state
    wait_for(lambda: state.get("heard") == {"driver": False, "planner": False, "runner": False})
    assert browser.press("ab", True) == {"done": False, "sentence": "no driver is heard"}
    publish("/ir_planner/cell", CellState(name="demo", cell_yaml=cell_to_yaml(load_cell("demo"))))
    with a_driver(ros_context):
        wait_for(lambda: state["heard"]["driver"], what="the driver is heard")
        wait_for(
            lambda: state.get("q") and state.get("near"), what="the robot and its nearest pair"
        )
        assert [part["name"] for part in browser.scene()["parts"]] == ["gear"]
        wait_for(lambda: state.get("plant") == "ideal" and state.get("load") == "gripper")
        wait_for(lambda: state.get("in", {}).get("move_enable") is True)
        assert browser.press("ab", True)["done"]
        wait_for(lambda: state["in"]["ab"], what="the bit in force")
        wait_for(lambda: state.get("out", {}).get("ab"), what="Bus Power Off")
        wait_for(lambda: state["mode"] == "BUS_POWER_OFF")
        assert browser.press("ab", False)["done"]
        assert browser.press("move_enable", False)["done"]  # the button `hold`
        wait_for(lambda: not state["in"]["ab"] and not state["in"]["move_enable"])
        assert "no bit of the PLC" in browser.press("EXT", True)["sentence"]
        before = state["stop"]
        assert browser.press("emergency_stop", True, "")["done"]  # whatever the page has seen
        wait_for(lambda: state["stop"] != before, what="the page shows the stop")
        for late in ("", before):
            assert not browser.press("emergency_stop", False, late)["done"]
        assert "which the sender knows" in browser.press("conf_mess", True, before)["sentence"]
        assert browser.press("emergency_stop", False)["done"]
    wait_for(lambda: not state["heard"]["driver"], what="the driver has gone")
    wait_for(lambda: state["w"] is None and state["near"] is None)
    with a_driver(ros_context):
        wait_for(lambda: state["heard"]["driver"] and state["w"], what="another driver")


def test_strange_messages_become_bounded_values_and_a_flood_twenty_records_a_second(
    browser: Browser, publish: Any, ros_executor: Any, wait_for: Any
) -> None:
    names = [f"{EVIL}{k}" for k in range(1000)]
    publish(
        "/ir_sim_driver/machine_states", MachineStates(equipment=names, states=names, next=names)
    )
    publish("/ir_planner/cell", CellState(cell_yaml=EVIL))
    publish("/ir_sim_driver/contacts", Contact(speed=float("nan"), depth=float("inf")))
    odd = ProgramState(event="started", index=7, total=3, note=EVIL * 1000)
    odd.movement.kind = "regional"
    odd.movement.from_station = EVIL * 1000
    publish("/ir_program_runner/program_state", odd)
    publish("/ir_program_runner/program_state", ProgramState(event=EVIL))
    wait_for(
        lambda: (
            "contact" in browser.state
            and browser.state.get("machines")
            and browser.state.get("step")
        )
    )
    assert len(browser.state["machines"]) == 100
    assert all(len(text) <= 200 for text in browser.state["step"].values() if isinstance(text, str))
    wait_for(lambda: "can't be read" in browser.state.get("problem", ""))
    before = len(browser.records)
    first = browser.state["t"]

    def flood() -> None:
        nan = float("nan")
        for k in range(3000):
            publish("/joint_states", JointState(name=["a", "b"], position=[nan, float(k)]))
            publish(
                "/ir_sim_driver/power_state", PowerState(power=nan if k % 2 else float(k), mode=200)
            )

    ros_executor.run(flood, timeout=PATIENCE)
    wait_for(lambda: browser.state.get("mode") == "mode 200")
    assert len(browser.records) - before <= 25.0 * (browser.state["t"] - first) + 5
    assert browser.state.get("q") is None


@pytest.fixture
def command() -> Iterator[subprocess.Popen[str]]:
    words = [sys.executable, "-m", "ir_cli.main", "view", "--live", "--port", "0"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    yield process
    process.kill()
    process.communicate()


@pytest.mark.long
def test_the_command_prints_its_address_and_ends_well_while_somebody_watches(
    command: subprocess.Popen[str], wait_for: Any
) -> None:
    assert command.stdout is not None
    address = command.stdout.readline().strip()
    host, _, token = address.removeprefix("http://127.0.0.1:").partition("/#")
    browser = Browser(int(host), token)
    wait_for(lambda: browser.state)
    command.send_signal(signal.SIGINT)
    _, errors = command.communicate(timeout=PATIENCE)
    assert command.returncode == 0
    assert errors == ""
