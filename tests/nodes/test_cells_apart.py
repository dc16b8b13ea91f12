"""Two cells in one graph: what they say carries their namespace, and they don't take each other's
port.
"""

from __future__ import annotations

import socket

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.parameter import Parameter

from ir_msgs.msg import PowerMode
from ir_msgs.srv import QueryModes, SetPlcInput, StartPause
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.diagnostics import OK, Condition, Diagnostics
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_sim_driver.node import SimDriver

QUICK = {
    "cell": "open",
    "backend": "ideal",
    "plc.debounce": 0.005,
    "plc.startup_window": 0.0,
    "transitions.hibernation_enter": 0.1,
    "transitions.hibernation_leave": 0.2,
    "transitions.hibernation_minimum_stay": 0.1,
}
WEEK = 604_800.0


@pytest.fixture
def taken_port():
    """A UDP port that another driver has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        yield other.getsockname()[1]


@pytest.fixture
def start_driver(ros_context, ros_executor):
    def start(namespace, wake_port):
        overrides = [
            Parameter(name, value=value)
            for name, value in {**QUICK, "wake_port": wake_port}.items()
        ]
        node = SimDriver(context=ros_context, namespace=namespace, parameter_overrides=overrides)
        return ros_executor.add_node(node)

    return start


def test_a_driver_that_nothing_can_wake_refuses_to_hibernate(
    start_driver, taken_port, ros_context, ros_node, wait_for
):
    said = []
    ros_node.create_subscription(
        DiagnosticArray,
        names.DIAGNOSTICS,
        lambda msg: said.extend(status.message for status in msg.status),
        10,
    )
    start_driver("cell_2", taken_port)
    with Client("cell_2", context=ros_context, timeout=PATIENCE) as client:
        answer = client.call(names.SET_PLC_INPUT, SetPlcInput.Request(name="hib", value=True))
        assert answer.status.code == StatusCode.INPUT_IGNORED
        assert "HIB is 1 but ignored: nothing could wake the controller" in answer.status.message
        assert str(taken_port) in answer.status.message
        wait_for(lambda: any("HIB ignored: nothing could wake" in text for text in said))
        modes = client.ask(names.QUERY_MODES, QueryModes.Request())
        assert modes.current == PowerMode.STAND_ON_MOTORS
        assert PowerMode.HIBERNATION not in {mode.mode for mode in modes.modes}
        client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="hib", value=False))
        wait_for(
            lambda: (
                client.call(names.START_PAUSE, StartPause.Request(pause=WEEK)).mode.mode
                == PowerMode.BUS_POWER_OFF
            )
        )


def test_a_driver_that_can_be_woken_hibernates(start_driver, ros_context, wait_for):
    start_driver("cell_1", 0)
    with Client("cell_1", context=ros_context, timeout=PATIENCE) as client:
        answer = client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="hib", value=True))
        assert answer.status.message == ""
        wait_for(
            lambda: (
                "off the network"
                in client.call(names.QUERY_MODES, QueryModes.Request()).status.message
            )
        )


def test_diagnostics_say_which_cell_they_are_of(start_driver, ros_node, wait_for):
    heard = set()
    ros_node.create_subscription(
        DiagnosticArray,
        names.DIAGNOSTICS,
        lambda msg: heard.update(status.name for status in msg.status),
        10,
    )
    start_driver("cell_1", 0)
    start_driver(None, 0)
    parts = {"ir_sim_driver: plant", "ir_sim_driver: controller", "ir_sim_driver: executor"}
    wait_for(lambda: heard == parts | {f"cell_1/{part}" for part in parts})


def test_two_nodes_of_one_name_say_so(ros_context, ros_executor, ros_node, wait_for):
    heard = []
    ros_node.create_subscription(
        DiagnosticArray, names.DIAGNOSTICS, lambda msg: heard.extend(msg.status), 10
    )
    node = ros_executor.add_node(Node("ir_sim_driver", context=ros_context, namespace="cell_1"))
    ros_executor.add_node(Node("ir_sim_driver", context=ros_context, namespace="cell_2"))
    diagnostics = ros_executor.run(lambda: Diagnostics(node))

    def said(name):
        ros_executor.run(lambda: diagnostics.publish([Condition("ir_sim_driver: plant", OK, "")]))
        return any(each.name == name for each in heard)

    wait_for(lambda: said("cell_1/ir_sim_driver: plant"))
    assert not said("cell_1/ir_sim_driver: name")
    ros_executor.add_node(Node("ir_sim_driver", context=ros_context, namespace="cell_1"))
    wait_for(lambda: said("cell_1/ir_sim_driver: name"))
    assert heard[-1].message.startswith("2 nodes are named /cell_1/ir_sim_driver")
