"""ROS domain of a command: environment of its nodes, one launcher per domain and namespace."""

from __future__ import annotations

import hashlib
import os
import socket
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from ir_cli.errors import CommandError
from ir_msgs_py.names import NODES
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.network import DOMAIN, network_variables

DEMONSTRATION_DOMAINS = range(1, 101)
"""ROS domain ids whose ports stay, for all participants, below the ephemeral ports of Linux."""


def ros_defaults() -> dict[str, str]:
    """Variables for nodes on this machine; raises InvalidValueError for an IR_NETWORK that is not
    known.
    """
    variables, _ = network_variables(os.environ)
    if "AMENT_PREFIX_PATH" not in os.environ:
        variables["AMENT_PREFIX_PATH"] = sys.prefix
    return variables


def apply(variables: Mapping[str, str]) -> None:
    """Put the variables into this process before rclpy reads them."""
    os.environ.update(variables)


def own_domain() -> dict[str, str]:
    """Return a ROS domain of this process's own, unless the user chose one."""
    if "ROS_DOMAIN_ID" in os.environ:
        return {}
    return {"ROS_DOMAIN_ID": str(DEMONSTRATION_DOMAINS[os.getpid() % len(DEMONSTRATION_DOMAINS)])}


# Discovery takes tenths of a second, so two launchers that start together do not see each other
# in the graph. A socket with a name of the kernel's own name space is taken by one of them, needs
# no file, and ends with its process.


def claim(domain: str, namespace: str) -> socket.socket | None:
    """The claim, which lasts until it is closed; None where the system has no such sockets.

    Raises CommandError when another process has it.
    """
    if not sys.platform.startswith("linux"):
        return None
    held = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        held.bind(f"\0{_name(domain, namespace)}")
    except OSError as error:
        held.close()
        where = f"in {namespace}" if namespace else "without a namespace"
        raise CommandError(
            f"another `ir ros up` or `ir demo` starts or runs the nodes {where} of domain "
            f"{domain or '0'}: end it, or choose another domain (ROS_DOMAIN_ID) or --namespace"
        ) from error
    return held


def claimed(domain: str, namespace: str) -> bool:
    """Whether a process of this host has the claim now; False where nobody can know."""
    try:
        names = Path("/proc/net/unix").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    wanted = f"@{_name(domain, namespace)}"
    return any(line.endswith(wanted) for line in names.splitlines())


def _name(domain: str, namespace: str) -> str:
    what = hashlib.sha256(f"{domain or '0'}\0{namespace}".encode()).hexdigest()[:32]
    return f"ir_up.{what}"


DISCOVERY_SECONDS = 1.0
"""For nodes that are there already to be seen; discovery on one machine takes tenths of a
second.
"""
POLL_SECONDS = 0.05


@contextmanager
def alone(namespace: str) -> Iterator[None]:
    """Alone as long as the block lasts. Raises CommandError, with a list of what is there."""
    held = claim(os.environ.get(DOMAIN, ""), namespace)
    try:
        refuse_beside(namespace)
        yield
    finally:
        if held is not None:
            held.close()


def refuse_beside(namespace: str) -> None:
    """CommandError with a list where nodes of the same names are in the graph."""
    names = {f"{namespace}/{name}" for name in NODES}
    with Client(node_name="ir_alone") as client:
        deadline = time.monotonic() + DISCOVERY_SECONDS
        there = list[str]()
        while not there and time.monotonic() < deadline:
            time.sleep(POLL_SECONDS)
            there = sorted(names & set(client.graph.nodes()))
    if there:
        raise CommandError(
            f"there already: {', '.join(there)}. "
            "End them, or choose another domain (ROS_DOMAIN_ID) or --namespace"
        )
