"""A foreign host on the same cable sees and reaches no node, also where it names this host as a
peer.
"""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from ir_msgs_py.ros.testing import PATIENCE

SCRIPT = Path(__file__).parent / "two_hosts.sh"
NODE = """
import sys
from std_srvs.srv import Trigger
from rclpy.node import Node
from ir_msgs_py.ros.node_process import run_node

class Offering(Node):
    def __init__(self):
        super().__init__("offering")
        self.create_service(Trigger, "hello", self.answer)

    def answer(self, request, response):
        response.success = True
        return response

run_node("offering", Offering, sys.argv)
"""
CLIENT = """
import time
import rclpy
from std_srvs.srv import Trigger
from rclpy.node import Node

rclpy.init()
node = Node("foreign")
client = node.create_client(Trigger, "hello")
found = client.wait_for_service(timeout_sec=PATIENCE)
if found:
    future = client.call_async(Trigger.Request())
    end = time.monotonic() + 60.0
    while not (future.done() and len(node.get_node_names()) > 1) and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    print("answered:", future.done())
print("nodes:", [name for name in node.get_node_names() if name != "foreign"])
print("found:", found)
"""


def from_the_other_host(folder: Path, network: str) -> str:
    node = folder / "node.py"
    client = folder / "client.py"
    node.write_text(NODE, encoding="utf-8")
    patience = (
        "60.0" if network == "insecure" else "10.0"
    )  # s; the client itself doesn't know of the network
    client.write_text(CLIENT.replace("PATIENCE", patience), encoding="utf-8")
    SCRIPT.chmod(SCRIPT.stat().st_mode | stat.S_IXUSR)
    root = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    command = ["unshare", *root, "--net", str(SCRIPT), sys.executable, str(node), str(client)]
    environment = {**os.environ, "IR_NETWORK": network, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    environment.pop("FASTRTPS_DEFAULT_PROFILES_FILE", None)
    run = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE, check=False, env=environment
    )
    assert "found:" in run.stdout, run.stderr
    return run.stdout


@pytest.mark.long
def test_a_foreign_host_sees_nothing(tmp_path: Path) -> None:
    heard = from_the_other_host(tmp_path, "loopback")
    assert "found: False" in heard
    assert "nodes: []" in heard


@pytest.mark.long
def test_opened_up_the_same_node_is_found(tmp_path: Path) -> None:
    """Else the test above would show nothing."""
    heard = from_the_other_host(tmp_path, "insecure")
    assert "found: True" in heard
    assert "nodes: ['offering']" in heard
    assert "answered: True" in heard
