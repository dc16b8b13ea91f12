"""Planner, driver and `ir_moveit` as processes, and a plain client that asks what MoveIt's panel in
RViz asks: names, order, waits and qualities of service of `PlanningSceneMonitor` and
`MoveGroupInterface` in MoveIt 2.12. Skipped where moveit_msgs or control_msgs is missing.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Pose
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import String

from ir_msgs_py.ros.testing import PATIENCE

moveit = pytest.importorskip("moveit_msgs.msg", reason="moveit_msgs is missing")
services = pytest.importorskip("moveit_msgs.srv", reason="moveit_msgs is missing")
actions = pytest.importorskip("moveit_msgs.action", reason="moveit_msgs is missing")
pytest.importorskip("control_msgs.action", reason="control_msgs is missing")

Codes = moveit.MoveItErrorCodes
Parts = moveit.PlanningSceneComponents
ALL = 1023  # every bit of PlanningSceneComponents, as the panel asks
DESCRIPTION = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SERVICES = QoSProfile(depth=10)
TURN = 0.4  # rad of the first joint
TIME = 60.0  # s: a busy machine's clock must not cut a plan
SLOW = 0.03  # of its speed: a busy machine must not see the end before it stops the robot
NEAR = 2e-3  # rad: what a robot that has arrived may miss


def node(module: str, *parameters: str) -> list[str]:
    words = [sys.executable, "-m", module, "--ros-args"]
    return [*words, *(word for each in parameters for word in ("-p", each))]


NODES = {
    "planner": node("ir_planner.node", "cell:=open"),
    "driver": node("ir_sim_driver.node", "cell:=open", "backend:=ideal", "wake_port:=0"),
    "moveit": node("ir_planner.node.moveit"),
}


@pytest.fixture
def ros_discovery_range() -> str:
    """The nodes are other processes of this machine."""
    return "SYSTEM_DEFAULT"


@pytest.fixture
def processes(ros_context: Any, tmp_path: Path) -> Iterator[dict[str, Any]]:
    """The three nodes; the context's fixture comes first, it says how far discovery reaches."""
    logs = {name: (tmp_path / f"{name}.log").open("w") for name in NODES}
    running = {
        name: subprocess.Popen(words, stdout=logs[name], stderr=subprocess.STDOUT)
        for name, words in NODES.items()
    }
    yield running
    for process in running.values():
        process.terminate()
    for process in running.values():
        process.wait(PATIENCE)
    for name, log in logs.items():
        log.close()
        assert "Traceback" not in (tmp_path / f"{name}.log").read_text()


class Panel:
    """What the panel does, in its order."""

    def __init__(self, node: Any, executor: Any, wait_for: Any) -> None:
        self.node = node
        self.executor = executor
        self.wait_for = wait_for
        self.texts = {
            name: self.listen(String, name, DESCRIPTION)
            for name in ("robot_description", "robot_description_semantic")
        }
        self.wait_for(lambda: all(self.texts.values()), what="both descriptions come")
        self.monitored = self.listen(moveit.PlanningScene, "monitored_planning_scene", SERVICES)
        self.paths = self.listen(moveit.DisplayTrajectory, "display_planned_path", SERVICES)
        self.states = self.listen(JointState, "joint_states", SERVICES)
        self.move = self.action(actions.MoveGroup, "move_action")
        self.drive = self.action(actions.ExecuteTrajectory, "execute_trajectory")

    def listen(self, kind: Any, topic: str, quality: QoSProfile) -> list[Any]:
        heard: list[Any] = []
        self.executor.run(
            lambda: self.node.create_subscription(kind, f"/{topic}", heard.append, quality)
        )
        return heard

    def action(self, kind: Any, name: str) -> ActionClient:
        client = self.executor.run(lambda: ActionClient(self.node, kind, f"/{name}"))
        self.wait_for(client.server_is_ready, what=f"{name} is offered")
        return client

    def ask(self, kind: Any, name: str, **fields: Any) -> Any:
        client = self.executor.run(lambda: self.node.create_client(kind, f"/{name}"))
        self.wait_for(client.service_is_ready, what=f"{name} is offered")
        future = self.executor.run(lambda: client.call_async(kind.Request(**fields)))
        self.wait_for(future.done, what=f"{name} answers")
        return future.result()

    def begin(self, client: ActionClient, goal: Any, feedback: list[str]) -> Any:
        sent = self.executor.run(
            lambda: client.send_goal_async(
                goal, feedback_callback=lambda heard: feedback.append(heard.feedback.state)
            )
        )
        self.wait_for(sent.done, what="the goal is answered")
        assert sent.result().accepted
        return self.executor.run(sent.result().get_result_async)

    def send(self, client: ActionClient, goal: Any) -> tuple[int, Any]:
        ended = self.begin(client, goal, [])
        self.wait_for(ended.done, what="the goal ends")
        return ended.result().status, ended.result().result

    def joints(self) -> dict[str, float]:
        last = self.states[-1]
        return dict(zip(last.name, last.position, strict=True))

    def scene(self, components: int = ALL) -> Any:
        wanted = Parts(components=components)
        return self.ask(services.GetPlanningScene, "get_planning_scene", components=wanted).scene

    def objects(self) -> set[str]:
        return {each.id for each in self.scene(Parts.WORLD_OBJECT_NAMES).world.collision_objects}


@pytest.fixture
def panel(processes: Any, ros_node: Any, ros_executor: Any, wait_for: Any) -> Panel:
    return Panel(ros_node, ros_executor, wait_for)


def move_goal(q: dict[str, float], *, plan_only: bool, start: dict[str, float] | None) -> Any:
    """What `MoveGroupInterface` sends for a joint target."""
    goal = actions.MoveGroup.Goal()
    request = goal.request
    request.group_name = "manipulator"
    request.num_planning_attempts = 10
    request.allowed_planning_time = TIME
    request.max_velocity_scaling_factor = 1.0
    request.max_acceleration_scaling_factor = 1.0
    request.workspace_parameters.header.frame_id = "cell"
    request.workspace_parameters.min_corner.x = -1.0
    request.workspace_parameters.max_corner.x = 1.0
    request.start_state.is_diff = start is None
    if start is not None:
        request.start_state.joint_state.name = list(start)
        request.start_state.joint_state.position = list(start.values())
    request.goal_constraints = [
        moveit.Constraints(
            joint_constraints=[
                moveit.JointConstraint(
                    joint_name=name,
                    position=value,
                    tolerance_above=1e-4,
                    tolerance_below=1e-4,
                    weight=1.0,
                )
                for name, value in q.items()
            ]
        )
    ]
    goal.planning_options.plan_only = plan_only
    goal.planning_options.planning_scene_diff.is_diff = True
    goal.planning_options.planning_scene_diff.robot_state.is_diff = True
    return goal


def turned(q: dict[str, float], angle: float) -> dict[str, float]:
    return {**q, "joint_a1": q["joint_a1"] + angle}


def apart(a: dict[str, float], b: dict[str, float]) -> float:
    return max(abs(a[name] - b[name]) for name in a)


def test_the_panel_finds_a_robot_model_that_agrees_with_itself(panel: Panel) -> None:
    """What `RobotModelLoader` needs of the two texts."""
    urdf = Xml.fromstring(panel.texts["robot_description"][-1].data)
    srdf = Xml.fromstring(panel.texts["robot_description_semantic"][-1].data)
    assert urdf.get("name") == srdf.get("name")
    links = {link.get("name") for link in urdf.iter("link")}
    joints = {joint.get("name") for joint in urdf.iter("joint") if joint.get("type") == "revolute"}
    parents = {
        joint.find("child").get("link"): joint.find("parent").get("link")  # type: ignore[union-attr]
        for joint in urdf.iter("joint")
    }
    (group,) = srdf.findall("group")
    (chain,) = group.findall("chain")
    link = chain.get("tip_link")
    passed = [link]
    while link != chain.get("base_link"):
        link = parents[link]
        passed.append(link)
    assert len(passed) > len(joints)
    for state in srdf.findall("group_state"):
        assert {joint.get("name") for joint in state} == joints
    pairs = [(d.get("link1"), d.get("link2")) for d in srdf.findall("disable_collisions")]
    assert links.issuperset(name for pair in pairs for name in pair)
    assert ("base_link", "link_1") in pairs
    scene = panel.scene()
    assert scene.robot_model_name == urdf.get("name")
    assert set(scene.robot_state.joint_state.name) == joints
    offered = panel.ask(services.QueryPlannerInterfaces, "query_planner_interface")
    (library,) = offered.planner_interfaces
    assert "tree" in library.planner_ids
    params = panel.ask(
        services.GetPlannerParams, "get_planner_params", planner_config="", group="manipulator"
    )
    assert not params.params.keys


def test_plan_execute_plan_and_execute_and_stop(panel: Panel) -> None:
    """The four buttons."""
    panel.wait_for(lambda: panel.states, what="joint_states come")
    begin = panel.joints()
    there = turned(begin, TURN)
    status, planned = panel.send(panel.move, move_goal(there, plan_only=True, start=begin))
    assert status == GoalStatus.STATUS_SUCCEEDED, planned.error_code.message
    assert planned.error_code.val == Codes.SUCCESS
    assert planned.planning_time > 0.0
    trajectory = planned.planned_trajectory.joint_trajectory
    end = dict(zip(trajectory.joint_names, trajectory.points[-1].positions, strict=True))
    assert apart(there, end) < 1e-6
    panel.wait_for(lambda: panel.paths, what="the path is drawn")
    assert panel.paths[-1].trajectory[0].joint_trajectory.points == trajectory.points

    plan = actions.ExecuteTrajectory.Goal(trajectory=planned.planned_trajectory)
    status, driven = panel.send(panel.drive, plan)
    assert status == GoalStatus.STATUS_SUCCEEDED, driven.error_code.message
    panel.wait_for(lambda: apart(panel.joints(), there) < NEAR, what="the robot is there")

    def told() -> bool:
        return any(
            apart(dict(zip(last.name, last.position, strict=True)), there) < NEAR
            for last in (scene.robot_state.joint_state for scene in panel.monitored[-1:])
        )

    panel.wait_for(told, what="the monitored scene says so")

    # what would begin elsewhere is not executed: neither planned from where the robot is not, nor
    # driven from there
    deviates = f"joint_a1 at {begin['joint_a1']:.4f} rad and the robot is at"
    status, refused = panel.send(panel.move, move_goal(begin, plan_only=False, start=begin))
    assert status == GoalStatus.STATUS_ABORTED
    assert refused.error_code.val == Codes.START_STATE_INVALID
    assert f"start_state has {deviates}" in refused.error_code.message
    assert "within 0.01 rad" in refused.error_code.message
    status, refused = panel.send(panel.drive, plan)
    assert status == GoalStatus.STATUS_ABORTED
    assert refused.error_code.val == Codes.INVALID_MOTION_PLAN
    assert f"the first point has {deviates}" in refused.error_code.message

    # plan and execute
    status, moved = panel.send(panel.move, move_goal(begin, plan_only=False, start=there))
    assert status == GoalStatus.STATUS_SUCCEEDED, moved.error_code.message
    panel.wait_for(lambda: apart(panel.joints(), begin) < NEAR, what="the robot is back")

    feedback: list[str] = []
    slow = move_goal(turned(begin, 3.0 * TURN), plan_only=False, start=None)
    slow.request.max_velocity_scaling_factor = SLOW
    stop = panel.executor.run(
        lambda: panel.node.create_publisher(String, "/trajectory_execution_event", 1)
    )
    panel.wait_for(stop.get_subscription_count, what="somebody can be stopped")
    ended = panel.begin(panel.move, slow, feedback)
    panel.wait_for(lambda: apart(panel.joints(), begin) > 0.01, what="the robot moves")
    panel.wait_for(lambda: feedback[:2] == ["PLANNING", "MONITOR"], what="it is said")
    panel.executor.run(lambda: stop.publish(String(data="stop")))
    panel.wait_for(ended.done, what="the goal ends")
    assert ended.result().status == GoalStatus.STATUS_ABORTED  # nobody canceled it
    assert ended.result().result.error_code.val == Codes.PREEMPTED
    assert apart(panel.joints(), turned(begin, 3.0 * TURN)) > 0.1


def test_a_goal_that_is_canceled_and_one_that_makes_no_sense_end_as_such(panel: Panel) -> None:
    panel.wait_for(lambda: panel.states, what="joint_states come")
    begin = panel.joints()
    # two goals at once are carried out one after the other, in the order in which they came
    both = [move_goal(turned(begin, k * TURN), plan_only=False, start=None) for k in (0.5, 0.0)]
    sent = [panel.executor.run(lambda goal=goal: panel.move.send_goal_async(goal)) for goal in both]
    panel.wait_for(lambda: all(each.done() for each in sent), what="both are taken")
    ends = [panel.executor.run(each.result().get_result_async) for each in sent]
    panel.wait_for(ends[1].done, what="the second ends")
    assert ends[0].done()
    results = [each.result().result for each in ends]
    assert [each.error_code.val for each in results] == [Codes.SUCCESS] * 2
    first, second = (each.planned_trajectory.joint_trajectory.points for each in results)
    assert np.abs(np.subtract(first[-1].positions, second[0].positions)).max() < NEAR
    panel.wait_for(lambda: apart(panel.joints(), begin) < NEAR, what="the robot is back")

    bad = move_goal(turned(begin, TURN), plan_only=True, start=begin)
    bad.request.group_name = "arm_2"
    status, refused = panel.send(panel.move, bad)
    assert status == GoalStatus.STATUS_ABORTED
    assert refused.error_code.val == Codes.INVALID_GROUP_NAME
    scene = move_goal(turned(begin, TURN), plan_only=True, start=begin)
    scene.planning_options.planning_scene_diff.world.collision_objects = [
        moveit.CollisionObject(id="x")
    ]
    status, refused = panel.send(panel.move, scene)
    assert "world of planning_scene_diff" in refused.error_code.message
    other = actions.ExecuteTrajectory.Goal(controller_names=["gripper_controller"])
    status, refused = panel.send(panel.drive, other)
    assert refused.error_code.val == Codes.CONTROL_FAILED
    slow = move_goal(turned(begin, 3.0 * TURN), plan_only=False, start=None)
    slow.request.max_velocity_scaling_factor = SLOW
    sent = panel.executor.run(lambda: panel.move.send_goal_async(slow))
    panel.wait_for(sent.done, what="the goal is taken")
    ended = panel.executor.run(sent.result().get_result_async)
    panel.wait_for(lambda: apart(panel.joints(), begin) > 0.01, what="the robot moves")
    panel.executor.run(sent.result().cancel_goal_async)
    panel.wait_for(ended.done, what="the goal ends")
    assert ended.result().status == GoalStatus.STATUS_CANCELED
    assert ended.result().result.error_code.val == Codes.PREEMPTED


def test_a_scene_that_the_panel_publishes_is_what_it_got_and_what_was_added(panel: Panel) -> None:
    """Scene objects: it publishes the whole scene, also what it does not change."""
    panel.wait_for(lambda: panel.states, what="joint_states come")
    whole = panel.scene()
    before = panel.objects()
    assert {each.id for each in whole.world.collision_objects} == before
    crate = moveit.CollisionObject(id="Box_0")
    crate.header.frame_id = "cell"
    crate.pose.position.z = 1.0
    crate.pose.position.x = 1.9
    crate.pose.orientation.w = 1.0
    crate.primitives = [SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.2] * 3)]
    crate.primitive_poses = [Pose()]
    whole.world.collision_objects.append(crate)
    publisher = panel.executor.run(
        lambda: panel.node.create_publisher(moveit.PlanningScene, "/planning_scene", 1)
    )
    panel.wait_for(publisher.get_subscription_count, what="somebody takes scenes")
    panel.executor.run(lambda: publisher.publish(whole))
    panel.wait_for(lambda: "Box_0" in panel.objects(), what="the object is in the scene")
    assert panel.objects() == before | {"Box_0"}

    def shown() -> bool:
        wholes = [scene for scene in panel.monitored if not scene.is_diff]
        return any(
            each.id == "Box_0" for scene in wholes[-1:] for each in scene.world.collision_objects
        )

    panel.wait_for(shown, what="the monitored scene has it")
    without = panel.scene()
    without.world.collision_objects = [
        each for each in without.world.collision_objects if each.id != "Box_0"
    ]
    panel.executor.run(lambda: publisher.publish(without))
    panel.wait_for(lambda: panel.objects() == before, what="the object is gone")
    poses = {each.id: each for each in panel.scene().world.collision_objects}
    for each in whole.world.collision_objects[:-1]:
        for place, same in zip(each.primitive_poses, poses[each.id].primitive_poses, strict=True):
            at = (place.position, same.position)
            assert np.allclose(*([p.x, p.y, p.z] for p in at), rtol=0.0, atol=1e-9)
