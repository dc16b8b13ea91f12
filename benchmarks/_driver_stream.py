"""The node as a process of its own, heard from this one: joint states, their periods and losses, its CPU."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np


def streamed(cell: str, seconds: float) -> dict[str, Any]:
    """Run the node as a process and listen to joint_states for so long."""
    os.environ.setdefault("ROS_DOMAIN_ID", "83")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    import rclpy
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import JointState

    command = [
        sys.executable,
        "-m",
        "ir_sim_driver.node",
        "--ros-args",
        "-p",
        f"cell:={cell}",
        "-p",
        "wake_port:=0",
    ]
    node_process = subprocess.Popen(command)
    rclpy.init()
    node = rclpy.create_node("driver_benchmark")
    arrivals: list[float] = []
    stamps: list[int] = []

    sent: list[int] = []

    def heard(msg: JointState, info: dict[str, int]) -> None:
        arrivals.append(time.monotonic())
        sent.append(info["source_timestamp"])
        stamps.append(msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec)

    node.create_subscription(JointState, "joint_states", heard, QoSProfile(depth=2000))
    try:
        limit = time.monotonic() + 60.0
        while len(arrivals) < 500 and time.monotonic() < limit:
            rclpy.spin_once(node, timeout_sec=0.1)
        arrivals.clear()
        sent.clear()
        stamps.clear()
        before, began = process_cpu(node_process.pid), time.monotonic()
        while time.monotonic() - began < seconds:
            rclpy.spin_once(node, timeout_sec=0.1)
        cpu = (process_cpu(node_process.pid) - before) / (time.monotonic() - began)
    finally:
        node_process.send_signal(signal.SIGINT)
        node_process.wait(10.0)
        node.destroy_node()
        rclpy.try_shutdown()
    periods = np.diff(arrivals) * 1e3
    return {
        "case": "streamed pybullet",
        "cell": cell,
        "messages": len(stamps),
        "lost": round((stamps[-1] - stamps[0]) / 2_000_000) + 1 - len(stamps),
        "rate_hz": (len(arrivals) - 1) / (arrivals[-1] - arrivals[0]),
        "p50_ms": float(np.percentile(periods, 50)),
        "p99_ms": float(np.percentile(periods, 99)),
        "p99_sent_ms": float(np.percentile(np.diff(sent) * 1e-6, 99)),  # without the listener's own delays
        "worst_ms": float(periods.max()),
        "cpu_percent": 100.0 * cpu,
    }


def process_cpu(pid: int) -> float:
    """User and system seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
