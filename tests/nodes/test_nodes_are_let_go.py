"""A node that was destroyed is let go, with its participant: a domain has places for some thirty of
one host.
"""

from __future__ import annotations

import gc
import weakref
from typing import Any

import pytest
import rclpy
from rclpy.context import Context

from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_planner.node.node import PlannerNode
from ir_program_runner.node import ProgramRunnerNode
from ir_sim_driver.node.node import SimDriver


@pytest.mark.parametrize("kind", [PlannerNode, SimDriver, ProgramRunnerNode])
def test_nothing_keeps_a_node_that_was_destroyed(
    kind: Any, ros_domain_id: int, wait_for: Any
) -> None:
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    with BackgroundExecutor(context) as executor:
        known = weakref.ref(executor.add_node(kind(context=context)))
    context.try_shutdown()
    del executor

    def gone() -> bool:
        gc.collect()
        return known() is None

    wait_for(gone, timeout=20.0, what="the node is let go")
