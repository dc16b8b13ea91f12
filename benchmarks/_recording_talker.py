"""Topics of a whole cell from one process: joint states at 1 kHz, each with its number in its
stamp.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from ir_msgs.msg import ControllerState, PowerState
from ir_msgs_py.names import JOINT_NAMES

PERIOD = 0.001  # s of the joint states
SIX = [0.1] * 6


def main() -> None:
    """Publish until standard input ends; every topic by its own share of the joint states."""
    rclpy.init()
    node = rclpy.create_node("talker")
    joints = JointState(name=list(JOINT_NAMES), position=SIX, velocity=SIX, effort=SIX)
    markers = MarkerArray(markers=[Marker(id=k) for k in range(30)])
    status = DiagnosticArray(status=[DiagnosticStatus(name="talker", message="fine")])
    power = PowerState(joint_power=SIX, joint_torque=SIX, joint_current=SIX, joint_temperature=SIX)
    others: list[tuple[str, Any, int]] = [
        ("/ir_sim_driver/power_state", power, 10),
        ("/ir_sim_driver/controller_state", ControllerState(joint_names=list(JOINT_NAMES)), 20),
        ("/ir_sim_driver/robot_markers", markers, 50),
        ("/ir_planner/text", String(data="x" * 1000), 100),
        ("/diagnostics", status, 250),
    ]
    deep = QoSProfile(depth=2000)
    states = node.create_publisher(JointState, "/joint_states", deep)
    shares = [(node.create_publisher(type(m), topic, deep), m, every) for topic, m, every in others]
    while not states.get_subscription_count():
        time.sleep(0.01)
    seconds = float(sys.argv[1])
    begun = time.monotonic()
    for k in range(round(seconds / PERIOD)):
        joints.header.stamp = Time(sec=k // 1000, nanosec=k % 1000 * 1_000_000)
        states.publish(joints)
        for publisher, message, every in shares:
            if k % every == 0:
                publisher.publish(message)
        time.sleep(max(begun + (k + 1) * PERIOD - time.monotonic(), 0.0))
    sys.stdout.write("done\n")
    sys.stdout.flush()
    sys.stdin.read()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
