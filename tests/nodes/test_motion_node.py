"""Another goal while the robot moves: planned on the trajectory that is driven, and joined."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from ir_msgs.srv import PlanRegionalMovement
from ir_msgs_py import names
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import trajectory_from_msg
from ir_msgs_py.ros.plan_conversions import plan_options_to_msg
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_sim_driver import make_simulation
from ir_sim_driver.node import SimDriver
from ir_values.errors import RequestRefusedError

SLOW = PlanOptions(include_points=True, planning_time=PATIENCE, velocity_scaling=0.1)
POINTS = plan_options_to_msg(PlanOptions(include_points=True, planning_time=PATIENCE))


@pytest.fixture
def cell_name() -> str:
    return "open"


@pytest.fixture
def simulation(planner_node: Any, ros_context: Any, ros_executor: Any) -> Any:
    simulation = make_simulation(planner_node.planner.cell, "cell", "ideal")
    quiet = [Parameter("wake_port", value=0)]
    ros_executor.add_node(SimDriver(simulation, context=ros_context, parameter_overrides=quiet))
    return simulation


def test_a_movement_is_left_for_another_goal_without_a_stop(
    simulation: Any, planner_node: Any, ros_context: Any, wait_for: Any, call: Any
) -> None:
    def standing() -> bool:
        planner_node._look()
        return planner_node._last_state.q is not None

    wait_for(standing, what="the planner hears the robot")
    ended: list[str] = []
    with (
        Client(context=ros_context, timeout=PATIENCE) as driving,
        Client(context=ros_context, timeout=PATIENCE) as replanning,
    ):
        first = driving.plan_to("park", SLOW)

        def drive() -> None:
            try:
                driving.execute(first.trajectory)
            except RequestRefusedError as error:
                ended.append(str(error))

        driver = threading.Thread(target=drive)
        driver.start()
        wait_for(lambda: simulation.executor.path_time > 0.0, what="the robot moves")
        at = 0.6 * first.trajectory.duration
        answer = call(
            PlanRegionalMovement,
            "plan_regional_movement",
            joins=first.trajectory_id,
            at=at,
            goal="home",
            options=POINTS,
        )
        assert answer.status.code == StatusCode.SUCCESS, answer.status.message
        assert answer.report.certified
        there = first.trajectory.sample([round(at, 9)])
        begin = answer.trajectory.points[0]
        assert np.abs(np.array(begin.positions) - there.q[0]).max() <= 1e-9
        assert np.abs(np.array(begin.velocities) - there.qd[0]).max() <= 1e-9
        assert np.abs(np.array(begin.accelerations) - there.qdd[0]).max() <= 1e-8
        assert simulation.executor.path_time < at, "the movement was over before the plan was there"
        replanning.execute(trajectory_from_msg(answer.trajectory))
        driver.join(PATIENCE)
    assert len(ended) == 1
    assert "preempted" in ended[0]
    assert np.abs(simulation.backend.q - planner_node.planner.cell.machine_home).max() < 5e-3


def test_motion_is_taken_as_it_is_said(planner_node: Any, call: Any) -> None:
    """Measured states of a robot that stands are rest; what moves moves; nonsense is refused."""
    cell = planner_node.planner.cell
    joints = list(cell.robot.joint_names)
    home = cell.machine_home.tolist()

    def asked(velocity: float = 0.0, **fields: Any) -> Any:
        start = JointState(name=joints, position=home, velocity=[velocity] + 5 * [0.0])
        fields.setdefault("start", start)
        return call(
            PlanRegionalMovement, "plan_regional_movement", goal="park", options=POINTS, **fields
        )

    still = asked()
    assert asked(0.009).trajectory_id == still.trajectory_id
    moving = asked(0.02)
    assert moving.trajectory.points[0].velocities[0] == 0.02
    literal = asked(0.009, start_acceleration=6 * [0.0])
    assert literal.trajectory.points[0].velocities[0] == 0.009
    backwards = joints[::-1]
    reverse = asked(
        start=JointState(name=backwards, position=home[::-1], velocity=5 * [0.0] + [0.02]),
        start_acceleration=5 * [0.0] + [0.1],
    )
    assert reverse.trajectory.points[0].velocities[0] == 0.02
    assert reverse.trajectory.points[0].accelerations[0] == 0.1
    empty = JointState()
    for fields, sentence in (
        ({"start_acceleration": [0.0]}, "start_acceleration has 1 values: it must have 6"),
        ({"start": empty, "start_acceleration": 6 * [0.0]}, "without start"),
        ({"goal_acceleration": 6 * [0.0]}, "goal_acceleration is given without goal_state"),
        ({"at": 1.0}, "at is 1 s without joins"),
        ({"joins": still.trajectory_id}, "start and joins are given"),
        ({"start": empty, "joins": "0123456789abcdef"}, "0123456789abcdef"),
        ({"start": empty, "joins": still.trajectory_id, "at": 1e4}, "the trajectory lasts from"),
        ({"start": empty, "joins": still.trajectory_id, "at": float("nan")}, "lasts from"),
    ):
        refused = asked(**fields)
        assert refused.status.code != StatusCode.SUCCESS
        assert sentence in refused.status.message
    assert f"{names.PLANNER}" in still.status.source
