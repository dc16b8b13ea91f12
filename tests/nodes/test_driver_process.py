"""The driver as a process: it says what is wrong with its parameters, and it ends when it is asked
to.
"""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from ir_msgs.msg import PowerState
from ir_msgs_py import names
from ir_msgs_py.ros.testing import PATIENCE
from ir_sim_driver.node import SimDriver
from ir_sim_driver.node.node import REFUSALS


def command(**parameters):
    words = [sys.executable, "-m", "ir_sim_driver.node", "--ros-args"]
    for name, value in {"cell": "open", "backend": "ideal", "wake_port": 0, **parameters}.items():
        words += ["-p", f"{name}:={value}"]
    return words


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        pytest.param({"cell": "nowhere"}, "known are", marks=pytest.mark.long),
        ({"plc.owner": r'"\e[2Jme"'}, 'owner is "\\x1b[2Jme": known are any'),
    ],
)
def test_a_parameter_that_makes_no_sense_ends_the_process_with_a_sentence(parameters, sentence):
    answer = subprocess.run(
        command(**parameters), capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert answer.returncode == 1
    assert sentence in answer.stderr
    assert "\x1b" not in answer.stderr
    assert "Traceback" not in answer.stderr


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("mac", "abc", "six hex bytes"),
        ("joint_state_rate", 300, "must divide 1000 Hz"),
        ("backend", "ode", "known are pybullet, ideal"),
        ("load", "anvil", "anvil"),
        ("cell", "nowhere", "known are"),
    ],
)
def test_a_parameter_that_makes_no_sense_is_a_refusal_of_the_node(
    ros_context, name, value, sentence
):
    """One of those that end the process as above."""
    values = {"cell": "open", "backend": "ideal", "wake_port": 0, name: value}
    overrides = [Parameter(key, value=each) for key, each in values.items()]
    with pytest.raises(REFUSALS, match=sentence):
        SimDriver(context=ros_context, parameter_overrides=overrides)


@pytest.mark.parametrize(
    "signals",
    [
        [signal.SIGINT, signal.SIGTERM],
        pytest.param([signal.SIGINT], marks=pytest.mark.long),
        pytest.param([signal.SIGTERM, signal.SIGTERM], marks=pytest.mark.long),
    ],
)
def test_signals_end_it_cleanly_also_two(signals, wait_for):
    """Wait for its meter, then signal: exit code 0."""
    context = Context()
    rclpy.init(context=context)
    node = Node("listener", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    heard = []
    node.create_subscription(PowerState, names.POWER_STATE, heard.append, 10)
    process = subprocess.Popen(
        command(modbus="true", modbus_port=0), stderr=subprocess.PIPE, text=True
    )
    try:

        def power():
            executor.spin_once(timeout_sec=0.1)
            return heard

        wait_for(power)
        for number in signals:
            process.send_signal(number)
        assert process.wait(PATIENCE) == 0
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()
    finally:
        process.kill()
        node.destroy_node()
        context.try_shutdown()


FAILING = """
import sys
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.node import main

step = Simulation.step

def fails_after_a_second(self):
    if self.steps > 1000:
        raise SystemError("no such body")
    step(self)

Simulation.step = fails_after_a_second
sys.exit(main())
"""


def test_a_plant_that_fails_ends_the_process_with_a_sentence_and_a_code():
    words = [sys.executable, "-c", FAILING, *command()[3:]]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE)
    assert ended.returncode == 1
    assert "the plant has stopped: SystemError('no such body')" in ended.stderr
    assert "Traceback" not in ended.stderr
