"""The driver's own participants for presses, in a graph where participants find each other."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, UInt64
from trajectory_msgs.msg import JointTrajectory as TrajectoryMsg

from ir_description import load_cell
from ir_msgs.msg import PlcInputs, PowerState
from ir_msgs.srv import Recover, SetPlcInput
from ir_msgs_py import names
from ir_msgs_py.modes import Mode
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import LATCHED
from ir_msgs_py.stop_numbers import stop_count
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.node import SimDriver

PRESSED = PlcInputs(emergency_stop=True, move_enable=True)
RELEASED = PlcInputs(move_enable=True)
SUSPENDED = 1.8  # s: less than what the driver takes for a gap
PRESSED_AFTER = 1.5  # s of these
HEARD_WITHIN = 0.5  # s after the driver runs again
TIMES = 10
MOVES = 0.02  # rad/s
STANDS = (Mode.STAND_ON_MOTORS, Mode.STAND_ON_BRAKES)


@pytest.fixture
def ros_discovery_range() -> str:
    """They are found."""
    return "SYSTEM_DEFAULT"


@pytest.mark.parametrize(
    "durability", [DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE]
)
def test_presses_count_beside_a_busy_executor_and_each_has_one_number(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any, durability: DurabilityPolicy
) -> None:
    """By topic and service, while the node's own executor is held up."""
    numbers: list[int] = []
    held = threading.Event()
    server = BackgroundExecutor(ros_context)
    parameters = {"cell": "open", "backend": "ideal", "wake_port": 0, "plc.startup_window": 0.0}
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    quality = QoSProfile(depth=10, durability=durability)
    try:
        server.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
        publisher, client, _ = ros_executor.run(
            lambda: (
                ros_node.create_publisher(PlcInputs, f"/{names.PLC_INPUTS}", quality),
                ros_node.create_client(SetPlcInput, f"/{names.SET_PLC_INPUT}"),
                ros_node.create_subscription(
                    UInt64,
                    f"/{names.STOP_NUMBER}",
                    lambda msg: numbers.append(stop_count(msg.data)),
                    LATCHED,
                ),
            )
        )
        heard_by = 2 if durability == DurabilityPolicy.VOLATILE else 4  # all levels, and presses
        wait_for(lambda: publisher.get_subscription_count() == heard_by, what="it listens twice")
        wait_for(client.service_is_ready, what="the service is there")
        holding = threading.Thread(target=lambda: server.run(lambda: held.wait(PATIENCE)))
        holding.start()
        ros_executor.run(lambda: publisher.publish(PRESSED))
        wait_for(lambda: numbers[-1:] == [1], what="the press counts")
        ros_executor.run(lambda: [publisher.publish(RELEASED) for _ in range(5)])

        def call(name: str, value: bool) -> Any:
            request = SetPlcInput.Request(name=name, value=value)
            future = ros_executor.run(lambda: client.call_async(request))
            wait_for(future.done, what="the driver answers")
            return future.result()

        wait_for(lambda: not call("move_enable", True).inputs.emergency_stop, what="it is let go")
        call("emergency_stop", True)
        wait_for(lambda: numbers[-1:] == [2], what="the press by service counts")
    finally:
        held.set()
        server.close()
    assert numbers == sorted(set(numbers))


class Heard:
    """What a driver tells: whether a stop is latched since the last `forget`, speed and mode."""

    def __init__(self, node: Any) -> None:
        self.latched: list[tuple[float, bool]] = []
        self.states: list[float] = []  # when joint states came
        self.speed = 0.0
        self.mode = -1
        node.create_subscription(Bool, f"/{names.STOP_LATCHED}", self._stop, LATCHED)
        node.create_subscription(JointState, f"/{names.JOINT_STATES}", self._moved, 1)
        node.create_subscription(PowerState, f"/{names.POWER_STATE}", self._powered, 1)

    def forget(self) -> None:
        """Begin anew."""
        self.latched.clear()
        self.states.clear()

    def latched_at(self) -> float:
        """When a latched stop was heard, 0 where none was."""
        return next((when for when, latched in self.latched if latched), 0.0)

    def _stop(self, msg: Bool) -> None:
        self.latched.append((time.monotonic(), msg.data))

    def _moved(self, msg: JointState) -> None:
        self.states.append(time.monotonic())
        self.speed = float(np.abs(msg.velocity).max())

    def _powered(self, msg: PowerState) -> None:
        self.mode = msg.mode


def to_and_fro(number: int) -> Any:
    """A slow movement from wherever the robot stands, to another side each time."""
    cell = load_cell("open")
    q = np.array(cell.machine_home)
    q[0] += 0.8 * (-1) ** number
    rest = np.zeros((1, 6))
    return trajectory_to_msg(
        JointTrajectory.from_seconds(cell.robot.joint_names, [12.0], q[None], rest, rest)
    )


@pytest.mark.long
def test_a_press_while_the_driver_is_suspended_counts_as_soon_as_it_goes_on(
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    ros_domain_id: int,
    monkeypatch: pytest.MonkeyPatch,
    wait_for: Any,
) -> None:
    """Its senders need not send again; the robot moves when it is suspended."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
    words = [sys.executable, "-m", "ir_sim_driver.node", "--ros-args"]
    for name, value in {"cell": "open", "backend": "ideal", "wake_port": 0}.items():
        words += ["-p", f"{name}:={value}"]
    heard = Heard(ros_node)
    levels = ros_node.create_publisher(PlcInputs, f"/{names.PLC_INPUTS}", LATCHED)
    movements = ros_node.create_publisher(TrajectoryMsg, f"/{names.COMMANDED_TRAJECTORY}", 10)
    late = []
    driver = subprocess.Popen(words)
    try:
        with Client(context=ros_context, timeout=PATIENCE) as client:
            wait_for(lambda: heard.states, what="the driver runs")
            for number in range(TIMES):
                levels.publish(RELEASED)

                def recovered() -> bool:
                    return bool(client.call(names.RECOVER, Recover.Request()).status.code == 1)

                wait_for(recovered, what="it recovers")
                wait_for(lambda: heard.mode in STANDS, what="it stands")
                wait_for(lambda: movements.get_subscription_count() > 0, what="it listens")
                movements.publish(to_and_fro(number))
                wait_for(lambda: heard.speed > MOVES, what="it moves")
                driver.send_signal(signal.SIGSTOP)
                time.sleep(PRESSED_AFTER)
                heard.forget()
                levels.publish(PRESSED)
                time.sleep(SUSPENDED - PRESSED_AFTER)
                assert not heard.latched
                driver.send_signal(signal.SIGCONT)
                wait_for(lambda: heard.states, what="it goes on")
                wait_for(heard.latched_at, what="the press counts")
                late.append(heard.latched_at() - heard.states[0])
    finally:
        driver.kill()
        driver.wait()
    assert max(late) < HEARD_WITHIN, late
