"""A listener that gets no processor for seconds finds every joint state when it is back."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from ir_msgs_py import names
from ir_sim_driver.node import SimDriver

COUNT = 1_500
STARVED = 2.0  # s of real time: who is not heard for 5 s is forgotten
LISTENER = """
import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

rclpy.init()
node = rclpy.create_node("starving")
stamps = []

def heard(msg):
    stamps.append(msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec)
    if len(stamps) == 1:
        print("hears", flush=True)

node.create_subscription(JointState, "joint_states", heard, QoSProfile(depth=4000))
while len(stamps) < COUNT:
    rclpy.spin_once(node)
print((stamps[-1] - stamps[0]) // 2_000_000 + 1 - len(stamps), flush=True)
rclpy.shutdown()  # which takes its shared memory away
"""


@pytest.fixture
def ros_discovery_range():
    return "LOCALHOST"


def test_two_seconds_without_a_processor_lose_nothing(
    ros_context, ros_executor, ros_node, ros_domain_id, monkeypatch, wait_for
):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
    overrides = {"cell": "open", "backend": "ideal", "wake_port": 0}
    ros_executor.add_node(
        SimDriver(
            context=ros_context,
            parameter_overrides=[Parameter(name, value=value) for name, value in overrides.items()],
        )
    )
    published = []
    ros_node.create_subscription(JointState, names.JOINT_STATES, published.append, QoSProfile(depth=2000))
    code = LISTENER.replace("COUNT", str(COUNT))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as listener:
        try:
            assert listener.stdout is not None
            assert listener.stdout.readline() == "hears\n"
            listener.send_signal(signal.SIGSTOP)
            begin, before = time.monotonic(), len(published)
            wait_for(lambda: time.monotonic() - begin >= STARVED)
            listener.send_signal(signal.SIGCONT)
            assert len(published) > before
            assert listener.stdout.readline() == "0\n"
            assert listener.wait(60.0) == 0
        finally:
            listener.kill()
