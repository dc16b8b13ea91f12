"""The driver's own participants for presses, in a graph where participants find each other."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import UInt64

from ir_msgs.msg import PlcInputs
from ir_msgs.srv import SetPlcInput
from ir_msgs_py import names
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import LATCHED
from ir_msgs_py.stop_numbers import stop_count
from ir_sim_driver.node import SimDriver

PRESSED = PlcInputs(emergency_stop=True, move_enable=True)
RELEASED = PlcInputs(move_enable=True)


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
