"""The node as a process of its own, heard from this one: joint states, their periods and losses,
its CPU.

A period is taken three times: where the node sends, where the middleware of this process receives,
and where this process, in Python, is called back. `bare` is a thread here that only sleeps until
the next stamp, before
the node starts: what the machine itself gives.
"""

from __future__ import annotations

import gc
import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from _node_process import running
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

# messages that are passed over, and how long they may take to come
FIRST = 500
STARTED_S = 60.0
PERIOD_NS = 2_000_000


@dataclass
class Heard:
    """When messages arrived [s], when they were received and sent [ns], and their stamps [ns]."""

    arrivals: list[float] = field(default_factory=list)
    received: list[int] = field(default_factory=list)
    sent: list[int] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)

    def hear(self, msg: JointState, info: dict[str, int]) -> None:
        """Take one message."""
        self.arrivals.append(time.monotonic())
        self.received.append(info["received_timestamp"])
        self.sent.append(info["source_timestamp"])
        self.stamps.append(msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec)

    def clear(self) -> None:
        """Forget all."""
        for times in (self.arrivals, self.received, self.sent, self.stamps):
            times.clear()


def streamed(cell: str, seconds: float) -> dict[str, Any]:
    """Run the node as a process and listen to joint_states for so long."""
    heard = Heard()
    bare = slept(seconds)
    with running("ir_sim_driver.node", cell=cell, wake_port=0) as process:
        rclpy.init()
        node = rclpy.create_node("driver_benchmark")
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        try:
            node.create_subscription(JointState, "joint_states", heard.hear, QoSProfile(depth=2000))
            limit = time.monotonic() + STARTED_S
            while len(heard.stamps) < FIRST and time.monotonic() < limit:
                executor.spin_once(timeout_sec=0.1)
            heard.clear()
            gc.collect()
            gc.freeze()  # a full collection here is no delay of the node
            before = process_cpu(process.pid)
            began = time.monotonic()
            while time.monotonic() - began < seconds:
                executor.spin_once(timeout_sec=0.1)
            cpu = (process_cpu(process.pid) - before) / (time.monotonic() - began)
        finally:
            executor.shutdown()
            node.destroy_node()
            gc.unfreeze()
            rclpy.try_shutdown()
    return {**_row(cell, heard, cpu), "p99_bare_ms": bare}


def slept(seconds: float) -> float:
    """99th percentile of the periods [ms] of a loop that only sleeps until the next stamp."""
    woken = [time.monotonic_ns()]
    due = time.monotonic_ns()
    for _ in range(round(1e9 * seconds / PERIOD_NS)):
        due += PERIOD_NS
        time.sleep(max(0.0, (due - time.monotonic_ns()) * 1e-9))
        woken.append(time.monotonic_ns())
    return _p99_ms(woken)


def _p99_ms(times_ns: list[int]) -> float:
    return float(np.percentile(np.diff(times_ns) * 1e-6, 99))


def _row(cell: str, heard: Heard, cpu: float) -> dict[str, Any]:
    """Periods and losses; cpu: share of a core that the node used."""
    stamps = heard.stamps
    arrivals = heard.arrivals
    periods = np.diff(heard.arrivals) * 1e3
    return {
        "case": "streamed pybullet",
        "cell": cell,
        "messages": len(stamps),
        "lost": round((stamps[-1] - stamps[0]) / PERIOD_NS) + 1 - len(stamps),
        "rate_hz": (len(arrivals) - 1) / (arrivals[-1] - arrivals[0]),
        "p50_ms": float(np.percentile(periods, 50)),
        "p99_ms": float(np.percentile(periods, 99)),
        "p99_received_ms": _p99_ms(heard.received),
        "p99_sent_ms": _p99_ms(heard.sent),
        "worst_ms": float(periods.max()),
        "cpu_percent": 100.0 * cpu,
    }


def process_cpu(pid: int) -> float:
    """User and system seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
