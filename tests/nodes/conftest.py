"""The planner's node for the tests of its services."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor, ShutdownException
from rclpy.parameter import Parameter

from ir_msgs.msg import PlanOptions
from ir_planner.node.node import PlannerNode

Call = Callable[..., Any]
PATIENT = 300.0  # s that a plan may take: what the clock of a busy machine cuts is another plan


@pytest.fixture
def cell_name() -> str:
    """The cell that the node starts with; a module may override it."""
    return "demo"


@pytest.fixture
def planner_node(ros_context: Any, cell_name: str) -> Iterator[PlannerNode]:
    """The node with a cell, spun by an executor of its own threads as in production."""
    node = PlannerNode(
        context=ros_context,
        parameter_overrides=[Parameter("cell", Parameter.Type.STRING, cell_name)],
    )
    executor = MultiThreadedExecutor(num_threads=4, context=ros_context)
    executor.add_node(node)

    def spin() -> None:
        with contextlib.suppress(ExternalShutdownException, ShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    yield node
    executor.shutdown(timeout_sec=60.0)  # a callback that still runs needs the node
    thread.join(60.0)
    node.destroy_node()


@pytest.fixture
def call(planner_node: PlannerNode, ros_node: Any, ros_executor: Any, wait_for: Any) -> Call:
    """Call a service of the planner by its type, name and request; no plan is cut by its usual
    time.
    """

    def ask(kind: Any, name: str, /, timeout: float = PATIENT, **fields: Any) -> Any:
        client = ros_executor.run(lambda: ros_node.create_client(kind, f"/ir_planner/{name}"))
        wait_for(client.service_is_ready, what=f"{name} is offered")
        request = kind.Request(**fields)
        options = getattr(request, "options", None)
        if (
            isinstance(options, PlanOptions)
            and options.planning_time == PlanOptions().planning_time
        ):
            options.planning_time = PATIENT
        future = ros_executor.run(lambda: client.call_async(request))
        wait_for(future.done, timeout=timeout, what=f"{name} answers")
        ros_executor.run(lambda: ros_node.destroy_client(client))
        return future.result()

    return ask
