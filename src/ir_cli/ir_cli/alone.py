"""Who starts nodes is alone in their domain and namespace: nobody else starts them, none are there
yet.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager

from ir_msgs_py.names import NODES
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.network import DOMAIN

from .errors import CommandError
from .only_one import claim

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
