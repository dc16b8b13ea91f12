"""`ir ros live`: the running cell in a browser of this machine, until Ctrl-C."""

from __future__ import annotations

import argparse
import sys

from ir_cli.ports import TCP, free_port, is_free
from ir_cli.ros.up import absolute_namespace
from ir_msgs_py.ros.node_process import run_node
from ir_recorder.errors import RecorderError
from ir_recorder.live.node import LiveNode

PORT = 8870


def add_live(live: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros live`."""
    live.add_argument("--namespace", default="", help="of the cell's nodes: cell_1 (none)")
    live.add_argument(
        "--port", type=_port, help=f"on 127.0.0.1 ({PORT}, or a free one where that is taken)"
    )
    live.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until SIGINT or SIGTERM."""
    port = arguments.port
    namespace = absolute_namespace(arguments.namespace)
    if port is None:
        port = PORT if is_free(PORT, TCP) else free_port(TCP)

    def make() -> LiveNode:
        node = LiveNode(port, namespace=namespace or None)
        sys.stdout.write(f"{node.server.address}\n")
        sys.stdout.write(
            "open it in a browser of this machine; who has the address may press the buttons\n"
        )
        sys.stdout.flush()
        return node

    return run_node("ir ros live", make, [], refusals=(RecorderError,))


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(
            f"{text[:60]!r} must be a whole number 0 .. 65535; 0 is a free one"
        )
    return int(text)
