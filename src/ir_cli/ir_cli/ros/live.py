"""`ir view --live`: the running cell in a browser of this machine, until Ctrl-C."""

from __future__ import annotations

import sys

from ir_cli.ros.domain import apply, ros_defaults
from ir_cli.ros.up import absolute_namespace
from ir_msgs_py.ros.node_process import run_node
from ir_recorder.errors import RecorderError
from ir_recorder.live.node import LiveNode


def run_live(port: int, namespace: str) -> int:
    """Serve the page of the nodes in a namespace ("": none) until SIGINT or SIGTERM."""
    apply(ros_defaults())
    inside = absolute_namespace(namespace)

    def make() -> LiveNode:
        node = LiveNode(port, namespace=inside or None)
        sys.stdout.write(f"{node.server.address}\n")
        sys.stdout.write(
            "open it in a browser of this machine; who has the address may press the buttons\n"
        )
        sys.stdout.flush()
        return node

    return run_node("ir view --live", make, [], refusals=(RecorderError,))
