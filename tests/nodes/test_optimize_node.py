"""optimize_trajectory over ROS: a better trajectory by id or by its points, and every refusal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

from ir_msgs.srv import OptimizeTrajectory, PlanRegionalMovement
from ir_msgs_py.names import JOINT_NAMES, OPTIMIZE_TRAJECTORY, PLANNED_TRAJECTORY
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import trajectory_from_msg
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.node.node import PlannerNode
from ir_values.errors import RequestRefusedError

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
AWAY = np.radians([60.0, -90.0, 100.0, 0.0, 20.0, 0.0])
LITTLE = PlanOptions(planning_time=60.0, max_iterations=60_000)


@pytest.fixture
def client(planner_node: PlannerNode, ros_context: Any) -> Iterator[Client]:
    with Client(context=ros_context, timeout=PATIENCE) as client:
        yield client


def slow(velocities: bool = True) -> JointTrajectory:
    rest = np.zeros((2, 6)) if velocities else None
    return JointTrajectory.from_seconds(
        JOINT_NAMES, [0.0, 20.0], np.stack([HOME, AWAY]), rest, rest
    )


def test_points_in_any_order_of_joints_become_a_stored_and_published_trajectory(
    client: Client, ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    heard: list[JointTrajectoryMsg] = []
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    ros_executor.run(
        lambda: ros_node.create_subscription(
            JointTrajectoryMsg, PLANNED_TRAJECTORY, heard.append, latched
        )
    )
    found = client.optimize(slow().reordered(JOINT_NAMES[::-1]), LITTLE)
    assert found.trajectory is None
    assert found.before.certified
    assert found.before.duration == pytest.approx(20.0)
    assert found.after.certified
    assert found.after.energy < found.before.energy
    assert (np.diff(found.durations) > 0.0).all()
    assert (np.diff(found.energies) < 0.0).all()
    assert len(found.durations) == len(found.energies) >= 2
    assert found.info.planner_id == "descent"
    np.testing.assert_allclose(found.info.start, HOME)
    stored = client.get_trajectory(found.trajectory_id)
    assert stored.trajectory_id == found.trajectory_id
    assert np.array_equal(stored.positions[[0, -1]], np.stack([HOME, AWAY]))
    wait_for(lambda: bool(heard), what="the trajectory is published")
    assert trajectory_from_msg(heard[-1]).trajectory_id == found.trajectory_id


def test_a_planned_trajectory_is_taken_by_its_id_and_points_come_where_they_are_asked_for(
    client: Client,
) -> None:
    start = JointState(name=list(JOINT_NAMES), position=HOME.tolist())
    request = PlanRegionalMovement.Request(start=start, goal="A1 60 A2 -90 A3 100 A4 0 A5 20 A6 0")
    planned = client.ask("/ir_planner/plan_regional_movement", request)
    options = PlanOptions(
        objective="time", include_points=True, planning_time=60.0, max_iterations=60_000
    )
    found = client.optimize(planned.trajectory_id, options)
    assert found.trajectory is not None
    assert found.trajectory.trajectory_id == found.trajectory_id
    assert found.after.duration <= planned.report.duration
    assert found.durations[0] <= found.after.duration
    assert client.optimize(planned.trajectory_id, options).trajectory_id == found.trajectory_id


def test_what_makes_no_sense_is_answered_by_a_sentence(client: Client) -> None:
    def refused(
        trajectory: JointTrajectory | str, options: PlanOptions = LITTLE
    ) -> RequestRefusedError:
        with pytest.raises(RequestRefusedError) as caught:
            client.optimize(trajectory, options)
        return caught.value

    assert "is unknown" in str(refused("0123456789abcdef"))
    moving = JointTrajectory.from_seconds(
        JOINT_NAMES, [0.0, 20.0], np.stack([HOME, AWAY]), np.array([[0.1] + 5 * [0.0], 6 * [0.0]])
    )
    error = refused(moving)
    assert error.code == StatusCode.INVALID_MOTION_PLAN
    assert "starts with velocity 0.1 rad/s of joint_a1" in str(error)
    assert "the shortest found within the limits" in str(
        refused(slow(False), PlanOptions(duration=0.1, planning_time=60.0))
    )
    answer = client.call(OPTIMIZE_TRAJECTORY, OptimizeTrajectory.Request())
    assert "exactly one of trajectory_id and trajectory" in answer.status.message
    assert answer.status.source == "ir_planner"
    names = JointTrajectory.from_seconds(("a", "b"), [0.0, 1.0], np.zeros((2, 2)))
    assert "unknown joint 'a'" in str(refused(names))
    assert client.optimize(slow(), LITTLE).after.certified
