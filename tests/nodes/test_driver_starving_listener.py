"""A listener that gets no processor for a while finds every joint state when it is back."""

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
from ir_msgs_py.ros.testing import PATIENCE
from ir_sim_driver.node import SimDriver

COUNT = 1_500
PERIOD = 2_000_000  # ns between two joint states
STARVED = 400  # joint states at least: a busy machine makes some hundred more before it is seen
# s: a busy machine may leave it stopped for longer, and who is not heard for 10 s is forgotten
LONGEST = 8.0
MOST = 1_800  # joint states that it may miss meanwhile: 2,000 are kept for it
TRIES = 20
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
print(stamps[0], stamps[-1], len(stamps), flush=True)
rclpy.shutdown()
"""


@pytest.fixture
def ros_discovery_range():
    return "SYSTEM_DEFAULT"


def stamp_of(msg):
    return msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec


def starve(listener, published, wait_for):
    """What the listener says after a while without a processor; "" where it was too long
    without.
    """
    with listener:
        try:
            assert listener.stdout is not None
            assert listener.stdout.readline() == "hears\n"
            listener.send_signal(signal.SIGSTOP)
            begin = time.monotonic()
            before = len(published)
            wait_for(
                lambda: len(published) - before >= STARVED or time.monotonic() - begin > LONGEST
            )
            listener.send_signal(signal.SIGCONT)
            missed = len(published) - before
            if time.monotonic() - begin > LONGEST or missed > MOST:
                return ""
            said = listener.stdout.readline()
            assert listener.wait(PATIENCE) == 0
            return said
        finally:
            listener.kill()


def test_who_gets_no_processor_for_a_while_loses_nothing(
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
    ros_node.create_subscription(
        JointState,
        names.JOINT_STATES,
        lambda msg: published.append(stamp_of(msg)),
        QoSProfile(depth=4000),
    )
    wait_for(lambda: published, what="the driver publishes")
    words = [sys.executable, "-c", LISTENER.replace("COUNT", str(COUNT))]
    tries = (subprocess.Popen(words, stdout=subprocess.PIPE, text=True) for _ in range(TRIES))
    said = next(filter(None, (starve(listener, published, wait_for) for listener in tries)))
    first, last, count = map(int, said.split())
    assert last - first == (count - 1) * PERIOD
