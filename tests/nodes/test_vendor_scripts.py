"""Ten scripts as vendors ship them for trajectory controllers, in our words, with a real driver.

They write what such a script writes into the fields of FollowJointTrajectory; ExecuteTrajectory has
the same ones. Where control_msgs is installed, its action takes them as well.
"""

from __future__ import annotations

from math import cos, pi

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import JointTolerance
from ir_msgs_py import names
from ir_sim_driver.motion import ErrorCode
from ir_sim_driver.node import SimDriver
from ir_sim_driver.node.controller_interface import control_type

HOME = np.array([0.0, -pi / 2, pi / 2, 0.0, 0.0, 0.0])
JOINTS = [f"joint_a{k}" for k in range(1, 7)]
OK = ErrorCode.SUCCESSFUL
FOLLOW = control_type("action", "FollowJointTrajectory")
ACTIONS = {names.EXECUTE_TRAJECTORY: ExecuteTrajectory}
if FOLLOW is not None:
    ACTIONS[names.FOLLOW_JOINT_TRAJECTORY] = FOLLOW


def duration(seconds):
    return Duration(sec=int(seconds), nanosec=round(seconds % 1.0 * 1e9))


def at(seconds, *turns, speeds=None, harder=None):
    """A point: how far the first joints have turned from home [rad]."""
    q = HOME.copy()
    q[: len(turns)] += turns
    return JointTrajectoryPoint(
        positions=q.tolist(),
        velocities=[] if speeds is None else [float(v) for v in speeds],
        accelerations=[] if harder is None else [float(a) for a in harder],
        time_from_start=duration(seconds),
    )


def trajectory(*points, joints=JOINTS):
    return JointTrajectory(joint_names=list(joints), points=list(points))


def rest(seconds, *turns):
    return at(seconds, *turns, speeds=np.zeros(6), harder=np.zeros(6))


class Robot:
    """The driver, and a client of one of its actions."""

    def __init__(self, driver, client, kind, executor, wait_for):
        self.driver = driver
        self.client = client
        self.kind = kind
        self.executor = executor
        self.wait_for = wait_for
        self.heard = []

    def send(self, message, **fields):
        goal = self.kind.Goal(trajectory=message, **fields)
        sent = self.executor.run(lambda: self.client.send_goal_async(goal))
        self.wait_for(sent.done, what="the goal is taken")
        return sent.result()

    def result(self, handle):
        ended = self.executor.run(handle.get_result_async)
        self.wait_for(ended.done, what="the goal ends")
        return ended.result().result

    def run(self, message, **fields):
        return self.result(self.send(message, **fields))

    def turned(self):
        """How far the joints are from home, by the last of `/joint_states`."""
        self.wait_for(lambda: self.heard, what="joint_states come")
        return np.array(self.heard[-1].position) - HOME


@pytest.fixture(params=ACTIONS)
def robot(request, ros_context, ros_executor, ros_node, wait_for):
    values = {"cell": "open", "backend": "ideal", "wake_port": 0}
    overrides = [Parameter(key, value=value) for key, value in values.items()]
    driver = ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    kind = ACTIONS[request.param]
    client = ros_executor.run(lambda: ActionClient(ros_node, kind, request.param))
    wait_for(client.server_is_ready, what="the action is offered")
    robot = Robot(driver, client, kind, ros_executor, wait_for)
    ros_executor.run(
        lambda: ros_node.create_subscription(JointState, names.JOINT_STATES, robot.heard.append, 10)
    )
    yield robot
    ros_executor.run(client.destroy)


def several_points_with_positions_only(robot):
    """A manufacturer's test_move: a few postures at fixed times, nothing else."""
    answer = robot.run(trajectory(at(0.8, 0.1), at(1.6, -0.1), at(2.4)))
    assert answer.error_code == OK, answer.error_string


def a_plan_with_times_and_velocities(robot):
    """What MoveIt's time parametrization hands over, from the present state at time 0."""
    times = np.linspace(0.0, 1.5, 16)
    s = times / 1.5
    w = 2.0 * pi / 1.5
    points = [
        at(
            t,
            0.15 * (share - np.sin(2 * pi * share) / (2 * pi)),
            speeds=0.15 / 1.5 * (1 - cos(w * t)) * np.eye(6)[0],
            harder=0.15 / 1.5 * w * np.sin(w * t) * np.eye(6)[0],
        )
        for t, share in zip(times, s, strict=True)
    ]
    answer = robot.run(trajectory(*points))
    assert answer.error_code == OK, answer.error_string
    assert answer.error_string == ""


def many_points_in_small_steps(robot):
    """A sine in steps of 20 ms, positions only."""
    points = [at(0.5 + t, 0.05 * (1 - cos(pi * t))) for t in np.arange(0.0, 2.001, 0.02)]
    answer = robot.run(trajectory(*points))
    assert answer.error_code == OK, answer.error_string


def goal_tolerances_and_their_time(robot):
    tolerances = [JointTolerance(name=name, position=0.01) for name in JOINTS]
    if robot.kind is not ExecuteTrajectory:
        kind = control_type("msg", "JointTolerance")
        tolerances = [kind(name=name, position=0.01) for name in JOINTS]
    answer = robot.run(
        trajectory(rest(1.0, 0.1)), goal_tolerance=tolerances, goal_time_tolerance=duration(0.5)
    )
    assert answer.error_code == OK, answer.error_string


def a_new_goal_preempts_the_old_one(robot):
    first = robot.send(trajectory(rest(3.0, 0.3)))
    robot.wait_for(lambda: robot.turned()[0] > 0.01, what="the robot moves")
    second = robot.send(trajectory(rest(1.5, 0.0)))
    assert robot.result(first).error_code == ErrorCode.INVALID_GOAL
    assert robot.result(second).error_code == OK


def a_cancel_stops_on_the_way(robot):
    handle = robot.send(trajectory(rest(4.0, 0.4)))
    robot.wait_for(lambda: robot.turned()[0] > 0.01, what="the robot moves")
    asked = robot.executor.run(handle.cancel_goal_async)
    robot.wait_for(asked.done, what="the cancel is answered")
    assert asked.result().goals_canceling
    robot.result(handle)
    assert 0.01 < robot.turned()[0] < 0.3


def a_stamp_in_the_future_is_waited_for(robot):
    message = trajectory(rest(0.5, 0.05))
    begun = robot.driver.get_clock().now().nanoseconds
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(begun + 10**9, 10**9)
    answer = robot.run(message)
    assert answer.error_code == OK, answer.error_string
    assert robot.driver.get_clock().now().nanoseconds - begun > 1.4e9


def a_subset_of_the_joints_is_refused(robot):
    point = at(1.0, 0.1)
    point.positions = point.positions[:3]
    answer = robot.run(trajectory(point, joints=JOINTS[:3]))
    assert answer.error_code == ErrorCode.INVALID_JOINTS
    assert "joint_a4" in answer.error_string


def the_order_of_the_joints_is_the_script_s(robot):
    order = [5, 2, 0, 1, 4, 3]
    point = at(1.0, 0.2, 0.1, -0.1)
    point.positions = [point.positions[k] for k in order]
    answer = robot.run(trajectory(point, joints=[JOINTS[k] for k in order]))
    assert answer.error_code == OK, answer.error_string
    assert robot.turned()[:3] == pytest.approx([0.2, 0.1, -0.1], abs=2e-3)


def the_topic_takes_it_without_an_answer(robot):
    publisher = robot.executor.run(
        lambda: robot.driver.create_publisher(JointTrajectory, names.COMMANDED_TRAJECTORY, 10)
    )
    robot.wait_for(publisher.get_subscription_count, what="the driver listens")
    publisher.publish(trajectory(rest(1.0, 0.1)))
    robot.wait_for(lambda: robot.turned()[0] > 0.099, what="the robot is there")


SCRIPTS = [
    pytest.param(several_points_with_positions_only, marks=pytest.mark.long),
    a_plan_with_times_and_velocities,
    pytest.param(many_points_in_small_steps, marks=pytest.mark.long),
    goal_tolerances_and_their_time,
    a_new_goal_preempts_the_old_one,
    a_cancel_stops_on_the_way,
    pytest.param(a_stamp_in_the_future_is_waited_for, marks=pytest.mark.long),
    a_subset_of_the_joints_is_refused,
    the_order_of_the_joints_is_the_script_s,
    the_topic_takes_it_without_an_answer,
]


@pytest.mark.sampled
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: getattr(script, "__name__", None))
def test_a_script_for_trajectory_controllers_runs(robot, script):
    script(robot)
