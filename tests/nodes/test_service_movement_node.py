"""plan_service_movement and compute_ik by ccd over ROS: candidates, ids, markers, and every
refusal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

from ir_msgs.msg import PlanOptions, Status
from ir_msgs.srv import ComputeIk, GetTrajectory, PlanServiceMovement, SetEquipment
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.ros.conversions import trajectory_from_msg

Call = Callable[..., Any]
SERVICE = "plan_service_movement"


def test_exit_and_entry_are_certified_and_their_points_can_be_fetched(call: Call) -> None:
    for direction in ("exit", "entry"):
        answer = call(PlanServiceMovement, SERVICE, station="lathe_work", direction=direction)
        assert answer.status.code == Status.SUCCESS, answer.status.message
        best = answer.candidates[0]
        assert best.report.certified
        assert best.method == answer.info.planner_id == "modified_ga"
        assert not best.trajectory.points
        fetched = call(GetTrajectory, "get_trajectory", trajectory_id=best.trajectory_id)
        trajectory = trajectory_from_msg(fetched.trajectory)
        ends = (best.work_configuration.position, best.outside_configuration.position)
        first, last = ends if direction == "exit" else ends[::-1]
        np.testing.assert_allclose(trajectory.positions[0], first)
        np.testing.assert_allclose(trajectory.positions[-1], last)


def test_the_same_seed_gives_the_same_trajectory_id(call: Call) -> None:
    request = {"station": "lathe_work", "options": PlanOptions(seed=7), "max_candidates": 1}
    ids = {
        call(PlanServiceMovement, SERVICE, **request).candidates[0].trajectory_id for _ in range(2)
    }
    assert len(ids) == 1


def test_markers_show_the_zone_the_candidates_and_their_closest_pairs(
    call: Call, ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    seen: list[MarkerArray] = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    ros_executor.run(
        lambda: ros_node.create_subscription(
            MarkerArray, "/ir_planner/markers", seen.append, latched
        )
    )
    answer = call(PlanServiceMovement, SERVICE, station="lathe_work", max_candidates=2)
    wanted = {"service_zone", "service_candidates", "service_closest", "zones"}

    def shown() -> MarkerArray | None:
        complete = (each for each in list(seen) if wanted <= {marker.ns for marker in each.markers})
        return next(complete, None)

    message = wait_for(shown, what="the candidates are shown")
    lines = [marker for marker in message.markers if marker.ns == "service_candidates"]
    assert len(lines) == len(answer.candidates)


def test_ccd_finds_what_the_closed_form_has(call: Call) -> None:
    analytic = call(ComputeIk, "compute_ik", goal="lathe_work", method="analytic")
    searched = call(ComputeIk, "compute_ik", goal="lathe_work", method="ccd", seed=3)
    assert searched.status.code == Status.SUCCESS, searched.status.message
    complete = np.array([solution.state.position for solution in analytic.solutions])
    for solution in searched.solutions:
        assert np.abs(complete - np.array(solution.state.position)).max(axis=1).min() < 1e-4
    assert searched.info.seed == 3
    assert analytic.info.iterations == 0
    assert 32 <= searched.info.iterations <= 32 * 6  # sweeps of 32 starts


@pytest.mark.parametrize(
    ("fields", "code", "word"),
    [
        ({"station": "nowhere"}, Status.INVALID_OBJECT_NAME, "lathe_work"),
        ({"station": "lathe_work", "direction": "up"}, Status.INVALID_GOAL_CONSTRAINTS, "entry"),
        (
            {"station": "lathe_work", "max_candidates": 0},
            Status.INVALID_GOAL_CONSTRAINTS,
            "max_candidates",
        ),
        (
            {"station": "lathe_work", "options": PlanOptions(planner_id="magic")},
            Status.INVALID_GOAL_CONSTRAINTS,
            "modified_ga",
        ),
        (
            {
                "station": "lathe_work",
                "configuration": JointState(
                    name=list(JOINT_NAMES), position=[9.0, 0.0, 0.0, 0.0, 0.0, 0.0]
                ),
            },
            Status.INVALID_ROBOT_STATE,
            "deg",
        ),
        (
            {
                "station": "lathe_work",
                "configuration": JointState(
                    name=list(JOINT_NAMES), position=[-1.57, -0.1, 0.1, 0.0, 0.0, 0.0]
                ),
            },
            Status.START_STATE_IN_COLLISION,
            "must be more than",
        ),
    ],
)
def test_bad_requests_are_answered_and_the_node_lives_on(
    call: Call, fields: dict[str, Any], code: int, word: str
) -> None:
    answer = call(PlanServiceMovement, SERVICE, **fields)
    assert answer.status.code == code, answer.status.message
    assert word in answer.status.message
    assert not answer.candidates
    assert call(ComputeIk, "compute_ik", goal="lathe_work").status.code == Status.SUCCESS


def test_a_closed_door_leaves_no_configuration_and_says_the_best_clearance(call: Call) -> None:
    call(SetEquipment, "set_equipment", name="lathe", state="door_closed")
    answer = call(PlanServiceMovement, SERVICE, station="lathe_work")
    assert answer.status.code == Status.GOAL_IN_COLLISION
    assert "best clearance" in answer.status.message
    assert "lathe_door_down" in answer.status.message
