"""Nodes that get no processor for seconds hear each other again, and who follows a killed node is
heard soon.
"""

from __future__ import annotations

import os
import random
import re
import select
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from ir_msgs_py.ros import network
from ir_msgs_py.ros.testing import PATIENCE, WaitFor

NODES = 3  # and one that follows the killed
STARVING = 40.0  # s
STARVED = (0.3, 1.2, 3.0, 7.0)  # s without a processor, at most; half as long at least
HEARD = 60.0  # s; with shared memory they stay deaf for good
COUNTING = """
import sys
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Int64
from ir_msgs_py.ros.node_process import run_node

OWN, COUNT = map(int, sys.argv[1:])
KEPT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)

class Counting(Node):
    def __init__(self):
        super().__init__(f"counting_{OWN}")
        self.last = [0] * COUNT
        self.numbers = self.create_publisher(Int64, f"/numbers_{OWN}", KEPT)
        for k in range(COUNT):
            heard = lambda msg, k=k: self.hear(k, msg.data)
            self.create_subscription(Int64, f"/numbers_{k}", heard, KEPT)
        self.create_timer(0.1, self.count)
        self.own = 0

    def hear(self, k, number):
        assert number == self.last[k] + 1, "a kept message was lost"
        self.last[k] = number

    def count(self):
        self.own += 1
        self.numbers.publish(Int64(data=self.own))
        print("heard", *self.last, flush=True)

run_node("counting", Counting, sys.argv[:1])
"""


SUSPENDED = """
from rclpy.node import Node
from ir_msgs_py.ros import node_process

class Sleeping(Node):
    def create_publisher(self, kind, topic, *more, **options):
        print("publishes", topic, flush=True)
        return super().create_publisher(kind, topic, *more, **options)

node_process.LEASE = 1.5
node_process.run_node("sleeping", lambda: Sleeping("sleeping"), [])
"""


def test_a_node_that_was_suspended_beyond_its_lease_says_so_and_its_name_again() -> None:
    """Whoever forgot a participant hears the names of its nodes when its endpoints change."""
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    command = [sys.executable, "-c", SUSPENDED]
    lines = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen(command, env=environment, **lines) as node:
        try:
            said = ""
            ends = time.monotonic() + PATIENCE
            while "publishes /rosout" not in said and time.monotonic() < ends:
                time.sleep(1.0)  # it may not have begun to look yet
                node.send_signal(signal.SIGSTOP)
                time.sleep(3.0)
                node.send_signal(signal.SIGCONT)
                while select.select([node.stdout], [], [], 2.0)[0]:
                    said += node.stdout.readline()
        finally:
            node.kill()
    assert "forgets who is silent for 1.5 s" in said
    assert "publishes /rosout" in said


@pytest.mark.parametrize("name", ["loopback", "fast_discovery"])
def test_the_lease_is_that_of_the_profiles(name: str) -> None:
    text = Path(network.profile(name)).read_text(encoding="utf-8")
    assert re.findall(r"<leaseDuration>\s*<sec>(\d+)</sec>", text) == [f"{network.LEASE:g}"]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_starved_nodes_hear_each_other_again_and_whoever_follows_the_killed(
    seed: int, tmp_path: Path, wait_for: WaitFor
) -> None:
    drawn = random.Random(seed)
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}
    with ExitStack() as ends:

        def start(k: int) -> subprocess.Popen[bytes]:
            log = ends.enter_context((tmp_path / f"{k}.log").open("w"))
            command = [sys.executable, "-c", COUNTING, str(k), str(NODES + 1)]
            node = subprocess.Popen(command, stdout=log, env=environment)
            ends.callback(node.kill)
            return node

        def last(k: int) -> list[int]:
            """The last number of each node that node `k` has heard."""
            said = re.findall(r"^heard ([\d ]+)\n", (tmp_path / f"{k}.log").read_text(), re.M)
            return [int(word) for word in said[-1].split()] if said else [0] * (NODES + 1)

        def hear_each_other(ids: list[int], since: list[int]) -> bool:
            return all(last(k)[other] > since[other] for k in ids for other in ids)

        nodes = []
        for k in range(NODES):
            nodes.append(start(k))
            time.sleep(drawn.uniform(0.0, 2.0))
        _starve(nodes, drawn)
        since = [max(numbers) for numbers in zip(*map(last, range(NODES)), strict=True)]
        wait_for(
            lambda: hear_each_other([*range(NODES)], since), timeout=HEARD, what="all hear all"
        )
        nodes[0].kill()
        nodes.append(start(NODES))
        others = [*range(1, NODES + 1)]
        wait_for(lambda: hear_each_other(others, since), timeout=HEARD, what="the new one is heard")
        assert [node.poll() for node in nodes[1:]] == [None] * NODES


def _starve(nodes: list[subprocess.Popen[bytes]], drawn: random.Random) -> None:
    """Stop the nodes again and again, each for itself; in the end all run."""
    runs = [True] * len(nodes)
    due = [0.0] * len(nodes)
    end = time.monotonic() + STARVING
    while time.monotonic() < end:
        for k, node in enumerate(nodes):
            if time.monotonic() < due[k]:
                continue
            runs[k] = not runs[k]
            node.send_signal(signal.SIGCONT if runs[k] else signal.SIGSTOP)
            starved = drawn.choice(STARVED) * drawn.uniform(0.5, 1.0)
            due[k] = time.monotonic() + (drawn.uniform(0.005, 0.3) if runs[k] else starved)
        time.sleep(0.005)
    for node in nodes:
        node.send_signal(signal.SIGCONT)
