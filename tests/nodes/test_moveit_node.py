"""A plain client of moveit_msgs against `ir_moveit` and `ir_planner`; skipped where moveit_msgs is
not installed.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Float64

from ir_msgs.msg import Status, TrajectoryReport
from ir_msgs_py.ros.conversions import pose_to_msg
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import LATCHED
from ir_planner.errors import CancelledError

moveit = pytest.importorskip("moveit_msgs.msg", reason="moveit_msgs is missing")
services = pytest.importorskip("moveit_msgs.srv", reason="moveit_msgs is missing")
Codes = moveit.MoveItErrorCodes
GOAL = (0.4, -1.4, 1.4, 0.0, 0.5, 0.0)
START = (0.0, -1.5707963267948966, 1.5707963267948966, 0.0, 0.0, 0.0)
TIME = 60.0  # s: a busy machine's clock must not cut a plan


@pytest.fixture
def cell_name() -> str:
    return "open"


@pytest.fixture
def adapter(ros_context: Any, planner_node: Any) -> Iterator[Any]:
    from ir_planner.node.moveit import MoveItNode

    node = MoveItNode(context=ros_context)
    executor = MultiThreadedExecutor(num_threads=4, context=ros_context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    yield node
    executor.shutdown(timeout_sec=PATIENCE)
    thread.join(PATIENCE)
    node.destroy_node()


@pytest.fixture
def ask(adapter: Any, ros_node: Any, ros_executor: Any, wait_for: Any) -> Any:
    def call(kind: Any, name: str, request: Any) -> Any:
        client = ros_executor.run(lambda: ros_node.create_client(kind, name))
        wait_for(client.service_is_ready, what=f"{name} is offered")
        future = ros_executor.run(lambda: client.call_async(request))
        wait_for(future.done, what=f"{name} answers")
        return future.result()

    return call


@pytest.fixture
def latched(ros_node: Any, ros_executor: Any) -> Any:
    heard: dict[str, list[Any]] = {}
    for name, kind in (("status", Status), ("report", TrajectoryReport), ("energy", Float64)):
        heard[name] = []
        ros_executor.run(
            lambda name=name, kind=kind: ros_node.create_subscription(
                kind, f"/ir_moveit/{name}", heard[name].append, LATCHED
            )
        )
    return heard


def state(values: Any) -> Any:
    own = moveit.RobotState()
    own.joint_state.name = [f"joint_a{k}" for k in range(1, 7)]
    own.joint_state.position = list(map(float, values))
    return own


def plan_request(**fields: Any) -> Any:
    goal = moveit.Constraints(
        joint_constraints=[
            moveit.JointConstraint(joint_name=f"joint_a{k + 1}", position=value, weight=1.0)
            for k, value in enumerate(GOAL)
        ]
    )
    request = moveit.MotionPlanRequest(
        group_name="manipulator",
        start_state=state(START),
        goal_constraints=[goal],
        allowed_planning_time=TIME,
        num_planning_attempts=1,
    )
    for name, value in fields.items():
        setattr(request, name, value)
    return services.GetMotionPlan.Request(motion_plan_request=request)


def crate(x: float, y: float, z: float, size: float = 0.3) -> Any:
    return moveit.CollisionObject(
        id="crate",
        pose=Pose(position=Point(x=x, y=y, z=z)),
        primitives=[SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[size] * 3)],
        primitive_poses=[Pose()],
    )


def test_a_goal_that_is_canceled_while_it_is_planned_ends_its_plan_and_at_once(
    adapter: Any,
    planner_node: Any,
    ros_node: Any,
    ros_executor: Any,
    wait_for: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The plan would take as long as the test has patience."""
    actions = pytest.importorskip("moveit_msgs.action")
    begun = threading.Event()
    ended: list[float] = []

    def endless(*, cancelled: Any, **asked: Any) -> Any:
        begun.set()
        wait_for(cancelled, what="the plan is cancelled")
        ended.append(time.monotonic())
        raise CancelledError("stopped on request")

    monkeypatch.setattr(planner_node.planner, "plan_regional", endless)
    client = ros_executor.run(lambda: ActionClient(ros_node, actions.MoveGroup, "/move_action"))
    wait_for(client.server_is_ready, what="the action is offered")
    goal = actions.MoveGroup.Goal(request=plan_request().motion_plan_request)
    goal.planning_options.plan_only = True
    sent = ros_executor.run(lambda: client.send_goal_async(goal))
    wait_for(sent.done, what="the goal is taken")
    answer = ros_executor.run(sent.result().get_result_async)
    wait_for(begun.is_set, what="it is planned")
    asked = time.monotonic()
    ros_executor.run(sent.result().cancel_goal_async)
    wait_for(answer.done, what="the goal ends")
    took = time.monotonic() - asked
    wait_for(lambda: ended, what="the plan ends")
    print(
        f"answered {took:.3f} s after the cancel, its plan ended {ended[0] - asked:.3f} s after it"
    )
    assert answer.result().status == GoalStatus.STATUS_CANCELED
    assert answer.result().result.error_code.val == Codes.PREEMPTED
    ros_executor.run(client.destroy)


def scene(*objects: Any) -> Any:
    given = moveit.PlanningScene(is_diff=True)
    given.world.collision_objects = list(objects)
    return services.ApplyPlanningScene.Request(scene=given)


def test_a_client_of_moveit_plans_and_hears_joules(ask: Any, latched: Any, wait_for: Any) -> None:
    planned = ask(services.GetMotionPlan, "plan_kinematic_path", plan_request())
    answer = planned.motion_plan_response
    assert answer.error_code.val == Codes.SUCCESS, answer.error_code.message
    points = answer.trajectory.joint_trajectory.points
    assert np.abs(np.array(points[0].positions) - START).max() < 1e-6
    assert np.abs(np.array(points[-1].positions) - GOAL).max() < 1e-6
    assert " J, clearance of" in answer.error_code.message
    wait_for(lambda: latched["energy"] and latched["report"], what="the report is published")
    assert latched["energy"][-1].data == latched["report"][-1].energy > 0.0
    refused = ask(
        services.GetMotionPlan, "plan_kinematic_path", plan_request(group_name="arm_2")
    ).motion_plan_response
    assert refused.error_code.val == Codes.INVALID_GROUP_NAME
    assert "the robot is the group manipulator" in refused.error_code.message
    wait_for(lambda: [s.code for s in latched["status"][-1:]] == [Codes.INVALID_GROUP_NAME])


def test_inverse_kinematics_and_a_path_begin_where_the_client_says(ask: Any) -> None:
    from ir_description import load_cell
    from ir_kernels.chain import Chain

    cell = load_cell("open")
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    pose = chain.tcp_poses(np.array([GOAL]))[0]
    request = services.GetPositionIK.Request()
    request.ik_request.robot_state = state(GOAL)
    request.ik_request.pose_stamped.header.frame_id = "cell"
    request.ik_request.pose_stamped.pose = pose_to_msg(pose)
    for avoid in (False, True):
        request.ik_request.avoid_collisions = avoid
        found = ask(services.GetPositionIK, "compute_ik", request)
        assert found.error_code.val == Codes.SUCCESS, found.error_code.message
        q = np.array(found.solution.joint_state.position)
        assert np.abs(chain.tcp_poses(q[None])[0] - pose).max() < 1e-6
    request.ik_request.pose_stamped.pose.position.x = 50.0
    nowhere = ask(services.GetPositionIK, "compute_ik", request)
    assert nowhere.error_code.val == Codes.NO_IK_SOLUTION
    lower = pose.copy()
    lower[2, 3] -= 0.1
    path = services.GetCartesianPath.Request(
        start_state=state(GOAL), waypoints=[pose_to_msg(lower)], max_step=0.01
    )
    moved = ask(services.GetCartesianPath, "compute_cartesian_path", path)
    assert moved.error_code.val == Codes.SUCCESS, moved.error_code.message
    assert moved.fraction == 1.0
    end = np.array([moved.solution.joint_trajectory.points[-1].positions])
    assert np.abs(chain.tcp_poses(end)[0] - lower).max() < 1e-4


def test_an_object_of_a_scene_is_in_the_way_until_it_is_taken_out(ask: Any, latched: Any) -> None:
    from ir_description import load_cell
    from ir_kernels.chain import Chain

    cell = load_cell("open")
    at = Chain(cell.robot, cell.base_pose, cell.tcp).tcp_poses(np.array([GOAL]))[0][:3, 3]
    valid = services.GetStateValidity.Request(robot_state=state(GOAL))
    assert ask(services.GetStateValidity, "check_state_validity", valid).valid
    applied = ask(services.ApplyPlanningScene, "apply_planning_scene", scene(crate(*at)))
    assert applied.success
    blocked = ask(services.GetStateValidity, "check_state_validity", valid)
    assert not blocked.valid
    assert "crate" in {contact.contact_body_2 for contact in blocked.contacts}
    planned = ask(services.GetMotionPlan, "plan_kinematic_path", plan_request())
    assert planned.motion_plan_response.error_code.val == Codes.GOAL_IN_COLLISION
    bad = crate(*at)
    bad.header.frame_id = "map"
    assert not ask(services.ApplyPlanningScene, "apply_planning_scene", scene(bad)).success
    gone = moveit.CollisionObject(id="crate", operation=moveit.CollisionObject.REMOVE)
    assert ask(services.ApplyPlanningScene, "apply_planning_scene", scene(gone)).success
    assert ask(services.GetStateValidity, "check_state_validity", valid).valid
