"""A robot that stands beyond a limit, or too near to something, gets a way out, is driven on it and
plans again: planner, driver and client as they run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter

from ir_description import load_cell
from ir_msgs.srv import PlanEscape, Recover
from ir_msgs_py import names
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_sim_driver import make_simulation
from ir_sim_driver.node import SimDriver
from ir_values.errors import RequestRefusedError

POINTS = PlanOptions(include_points=True, planning_time=PATIENCE)
BEYOND = 0.15  # rad: more than the supervision lets pass, less than 20 deg


@pytest.fixture
def cell_name() -> str:
    return "table_columns"


def beyond_a_limit(planner: Any) -> np.ndarray:
    q = np.array(planner.cell.machine_home)
    q[0] = planner.cell.robot.position_max[0] + BEYOND
    return q


def too_near(planner: Any) -> np.ndarray:
    """A drawn state within the limits, some millimetres below what a pair must keep."""
    draw = np.random.default_rng(5)
    robot = planner.cell.robot
    scene = planner.scene()
    while True:
        q = draw.uniform(robot.position_min, robot.position_max)
        short = (scene.thresholds(0.02) - scene.collision.distances(q[None])[0]).max()
        if 0.002 < short < 0.015 and planner.plan_escape(q).status.ok:
            return q


@pytest.mark.parametrize("stand", [beyond_a_limit, too_near])
def test_a_way_out_is_asked_for_driven_and_left_behind(
    stand: Callable[[Any], np.ndarray],
    planner_node: Any,
    ros_context: Any,
    ros_executor: Any,
    wait_for: Any,
) -> None:
    planner = planner_node.planner
    start = stand(planner)
    simulation = make_simulation(load_cell("table_columns"), "cell", "ideal")
    simulation.backend.reset(start)
    simulation.executor.hold(start)
    quiet = [Parameter("wake_port", value=0)]
    ros_executor.add_node(SimDriver(simulation, context=ros_context, parameter_overrides=quiet))

    def stands() -> bool:
        planner_node._look()
        last = planner_node._last_state
        near = last.q is not None and bool(np.abs(last.q - start).max() < 0.05)
        return near and bool(np.abs(last.velocity).max() < 1e-3)

    wait_for(lambda: simulation.stopped == (stand is beyond_a_limit), what="it is supervised")
    wait_for(stands, what="the planner knows where the robot stands")
    with Client(context=ros_context, timeout=PATIENCE) as client:
        with pytest.raises(RequestRefusedError, match=r"plan_escape|way out"):
            client.plan_to("home", POINTS)
        if simulation.stopped:
            client.ask(names.RECOVER, Recover.Request())
        out = client.plan_escape(options=POINTS)
        assert out.trajectory is not None
        assert not out.report.certified
        client.execute(out.trajectory, report=out.report)
        assert np.abs(simulation.backend.q - out.trajectory.positions[-1]).max() < 5e-3
        again = client.plan_to("home", POINTS)
        assert again.report.certified
        free = client.ask(names.PLAN_ESCAPE, PlanEscape.Request())
        assert free.status.code == StatusCode.SUCCESS
        assert free.trajectory_id == ""
