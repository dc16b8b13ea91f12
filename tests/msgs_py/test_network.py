"""Nodes are reached from this host only, unless somebody chose otherwise and said what it costs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from ir_msgs_py.ros.network import CHOICES, apply_network, network_variables, profile
from ir_msgs_py.ros.testing import PATIENCE
from ir_values.errors import InvalidValueError

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PEERS = "ROS_STATIC_PEERS"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
LOOPBACK = ("0100007F", "00000000000000000000000001000000")  # of /proc/net/udp and udp6


@pytest.mark.parametrize(
    "asked", ["SUBNET", "SYSTEM_DEFAULT", "", "LOCALHOST", "localhost", "nonsense"]
)
def test_whatever_the_range_says_discovery_stays_here(asked: str) -> None:
    environment = {RANGE: asked, PEERS: "192.0.2.7", PROFILES: "/somewhere/open.xml"}
    apply_network(environment)
    assert environment[RANGE] == "SYSTEM_DEFAULT"
    assert PEERS not in environment
    assert "<address>127.0.0.1</address>" in Path(environment[PROFILES]).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["loopback", "fast_discovery"])
def test_what_a_full_receiver_dropped_is_sent_again_soon(name: str) -> None:
    """By default it takes 3 s, and as long again each time that the receiver is full."""
    text = Path(profile(name)).read_text(encoding="utf-8")
    period = re.search(r"<heartbeatPeriod>\s*<sec>0</sec>\s*<nanosec>(\d+)", text)
    assert period is not None
    assert int(period[1]) <= 50_000_000


def test_another_middleware_is_bound_by_the_range() -> None:
    """It doesn't read the profile."""
    asked = {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp", RANGE: "SUBNET"}
    assert network_variables(asked)[0][RANGE] == "LOCALHOST"


@pytest.mark.parametrize("name", ["loopback", "fast_discovery"])
def test_shared_memory_is_left_out(name: str) -> None:
    """A process that is stopped for a second is taken for dead there, and stays deaf."""
    text = Path(profile(name)).read_text(encoding="utf-8")
    assert "<useBuiltinTransports>false</useBuiltinTransports>" in text
    assert re.findall(r"<type>(\w+)</type>", text) == ["UDPv4"]


def test_no_discovery_at_all_stays_none() -> None:
    assert network_variables({RANGE: "OFF"})[0][RANGE] == "OFF"


def test_what_is_not_followed_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    apply_network({RANGE: "SUBNET", PEERS: "192.0.2.7"})
    said = capsys.readouterr().err
    assert "SUBNET" in said
    assert "192.0.2.7" in said
    assert "IR_NETWORK=secure or IR_NETWORK=insecure" in said


def test_an_unknown_choice_lists_the_known() -> None:
    with pytest.raises(InvalidValueError, match="loopback, secure, insecure"):
        network_variables({"IR_NETWORK": "open"})


def test_secure_asks_for_security() -> None:
    asked = {"IR_NETWORK": "secure", "ROS_SECURITY_ENABLE": "true"}
    with pytest.raises(InvalidValueError, match="ROS_SECURITY_STRATEGY=Enforce must be set"):
        network_variables(asked)
    assert RANGE not in network_variables({**asked, "ROS_SECURITY_STRATEGY": "Enforce"})[0]


def test_insecure_leaves_ros_s_own_variables() -> None:
    variables, removed = network_variables(
        {"IR_NETWORK": "insecure", RANGE: "SUBNET", PEERS: "192.0.2.7"}
    )
    assert RANGE not in variables
    assert removed == ()
    assert set(CHOICES) == {"loopback", "secure", "insecure"}
    assert "fast_discovery.xml" in variables[PROFILES]
    own = {"IR_NETWORK": "insecure", PROFILES: "/my/own.xml"}
    assert network_variables(own) == ({}, ())


@pytest.mark.parametrize("name", ["loopback", "fast_discovery"])
def test_a_profile_of_ours_says_how_messages_are_kept(name: str) -> None:
    """Else the middleware keeps, for every message that ever waited, the size of the largest."""
    choice = {} if name == "loopback" else {"IR_NETWORK": "insecure"}
    assert network_variables(choice)[0]["RMW_FASTRTPS_USE_QOS_FROM_XML"] == "1"
    text = Path(profile(name)).read_text(encoding="utf-8")
    assert text.count("<historyMemoryPolicy>DYNAMIC</historyMemoryPolicy>") == 2


NODE = """
import os, sys
from rclpy.node import Node
from ir_msgs_py.ros.node_process import run_node

class Listed(Node):
    def __init__(self):
        super().__init__("listed")
        self.create_timer(0.1, self.show)
        self.looks = 0

    def show(self):
        self.looks += 1
        if self.looks == 5:
            links = [f"/proc/self/fd/{n}" for n in os.listdir("/proc/self/fd")]
            inodes = {os.readlink(link) for link in links if os.path.islink(link)}
            for family in ("udp", "udp6", "tcp", "tcp6"):
                for line in open(f"/proc/self/net/{family}").read().splitlines()[1:]:
                    fields = line.split()
                    if f"socket:[{fields[9]}]" in inodes:
                        print("socket", family, fields[1], fields[3], flush=True)
            print("done", flush=True)

run_node("listed", Listed, sys.argv, goes_on=lambda node: node.looks < 6)
"""


def test_a_node_started_without_any_preparation_listens_on_loopback_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ros_domain_id: int
) -> None:
    for name in (RANGE, PEERS, PROFILES):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(RANGE, "SUBNET")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
    script = tmp_path / "node.py"
    script.write_text(NODE, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=PATIENCE, check=True
    )
    sockets = re.findall(r"socket (\S+) ([0-9A-F]+):([0-9A-F]+)", run.stdout)
    assert "done" in run.stdout, run.stderr
    assert sockets, run.stdout
    assert {address for _, address, _ in sockets} <= set(LOOPBACK), sockets
    assert not any(family.startswith("tcp") for family, _, _ in sockets)
