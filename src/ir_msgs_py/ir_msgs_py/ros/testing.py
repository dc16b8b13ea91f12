"""Fixtures for tests of nodes without launch files: a context of their own, a spinning executor,
waiting.

A pytest plugin (entry point `ir_msgs_py`); every test is alone on its context, and without
discovery, so tests run in parallel. A test over processes overrides `ros_discovery_range` with
"SYSTEM_DEFAULT".

    def test_my_node_answers(ros_context, ros_executor, ros_node, wait_for):
        ros_executor.add_node(MyNode(context=ros_context))
        client = ros_node.create_client(Trigger, "/my_node/trigger")
        wait_for(client.service_is_ready)
"""

from __future__ import annotations

import atexit
import os
import socket
import time
from collections.abc import Callable, Iterator
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

import pytest

if TYPE_CHECKING:  # importing rclpy costs 0.2 s, and tests of a core don't need it
    from rclpy.context import Context
    from rclpy.node import Node

    from ir_msgs_py.ros.spinning import BackgroundExecutor

_DOMAINS = 101  # ids above need other ports than the system leaves free
_POLL = 0.005
PATIENCE = 300.0
"""Longest wait [s] for anything that must happen: a busy machine does within it what a free one
does at once, and only a test that fails waits so long.
"""


class WaitFor(Protocol):
    """Wait until the condition holds and return what it gave; fail the test after `timeout` [s]."""

    def __call__(
        self, condition: Callable[[], Any], timeout: float = PATIENCE, what: str = ""
    ) -> Any:
        """Wait."""


@cache
def own_domain() -> int:
    """ROS domain, 1 to 101, that no other test process of this host has: reserved until this
    process ends.

    The reservation is a name among the host's abstract sockets. Raises RuntimeError when none is
    left.
    """
    for k in range(_DOMAINS):
        domain = 1 + (os.getpid() + k) % _DOMAINS
        name = socket.socket(socket.AF_UNIX)
        try:
            name.bind(f"\0ir_msgs_py/test_domain/{domain}")
        except OSError:  # somebody has it
            name.close()
            continue
        atexit.register(name.close)
        return domain
    raise RuntimeError(f"each of the {_DOMAINS} domains for tests is in use")


@pytest.fixture(scope="session")
def ros_domain_id() -> int:
    """Domain of this test process alone, so that parallel sessions don't meet."""
    return own_domain()


@pytest.fixture
def ros_discovery_range() -> str:
    """Range of discovery: "OFF" keeps the nodes of this process to themselves."""
    return "OFF"


@pytest.fixture
def ros_context(
    ros_domain_id: int, ros_discovery_range: str, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Context]:
    """A context of its own: hand it to every node of the test."""
    import rclpy
    from rclpy.context import Context

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", ros_discovery_range)
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    yield context
    context.try_shutdown()


@pytest.fixture
def ros_executor(ros_context: Context) -> Iterator[BackgroundExecutor]:
    """An executor that spins in the background; it destroys the nodes that were added to it."""
    from ir_msgs_py.ros.spinning import BackgroundExecutor

    with BackgroundExecutor(ros_context) as executor:
        yield executor


@pytest.fixture
def ros_node(ros_context: Context, ros_executor: BackgroundExecutor) -> Node:
    """A plain node of the test, for its own clients, publishers and subscriptions."""
    from rclpy.node import Node

    return ros_executor.add_node(Node("test", context=ros_context))


@pytest.fixture
def wait_for() -> WaitFor:
    """Wait for a condition, never for a duration: `wait_for(lambda: received, what="the
    answer")`.
    """

    def wait(condition: Callable[[], Any], timeout: float = PATIENCE, what: str = "") -> Any:
        deadline = time.monotonic() + timeout
        while not (value := condition()):
            if time.monotonic() >= deadline:
                pytest.fail(f"{what or 'the condition'} did not come true within {timeout:g} s")
            time.sleep(_POLL)
        return value

    return wait
