"""What a client can send the driver by mistake: an answer with a sentence, and a node that lives
on.
"""

from __future__ import annotations

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint, MultiDOFJointTrajectoryPoint

from ir_description import load_cell
from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import JointTolerance, PlcInputs
from ir_msgs.srv import QueryModes, SetPlcInput, StartPause
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.node import SimDriver, node
from ir_values.errors import RequestRefusedError

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def movement(step=0.05, duration=0.5):
    cell = load_cell("open")
    q = np.array(cell.machine_home)
    return JointTrajectory.from_seconds(
        cell.robot.joint_names, [0.0, duration], [q, q + step], np.zeros((2, 6)), np.zeros((2, 6))
    )


@pytest.fixture
def driver(ros_context, ros_executor):
    overrides = {"cell": "open", "backend": "ideal", "wake_port": 0, "plc.startup_window": 0.0}
    node = SimDriver(
        context=ros_context,
        parameter_overrides=[Parameter(name, value=value) for name, value in overrides.items()],
    )
    return ros_executor.add_node(node)


@pytest.fixture
def client(ros_context, driver):
    with Client(context=ros_context, timeout=PATIENCE) as client:
        yield client


def nan_position(goal):
    goal.trajectory.points[1].positions[3] = float("nan")


def infinite_velocity(goal):
    goal.trajectory.points[0].velocities[0] = float("inf")


def unknown_joint(goal):
    goal.trajectory.joint_names[5] = "joint_a7"


def missing_joint(goal):
    goal.trajectory.joint_names.pop()
    for point in goal.trajectory.points:
        for field in (point.positions, point.velocities, point.accelerations):
            field.pop()


def double_joint(goal):
    goal.trajectory.joint_names[5] = "joint_a1"


def no_names(goal):
    goal.trajectory.joint_names = []


def no_points(goal):
    goal.trajectory.points = []


def short_positions(goal):
    goal.trajectory.points[1].positions.pop()


def long_velocities(goal):
    goal.trajectory.points[1].velocities.append(0.0)


def equal_times(goal):
    goal.trajectory.points[1].time_from_start = goal.trajectory.points[0].time_from_start


def negative_time(goal):
    goal.trajectory.points[0].time_from_start.sec = -1


def nanoseconds_of_a_second(goal):
    goal.trajectory.points[1].time_from_start.nanosec = 1_000_000_000


def with_effort(goal):
    goal.trajectory.points[1].effort = [0.0] * 6


def with_multi_dof(goal):
    goal.multi_dof_trajectory.joint_names = ["base"]
    goal.multi_dof_trajectory.points = [MultiDOFJointTrajectoryPoint()]


def old_stamp(goal):
    goal.trajectory.header.stamp.sec = 1


def strange_tolerance(goal):
    goal.path_tolerance = [JointTolerance(name="joint_a1", position=float("nan"))]


def many_points(goal):
    point = goal.trajectory.points[0]
    goal.trajectory.points = [
        JointTrajectoryPoint(positions=point.positions, velocities=point.velocities)
        for _ in range(20_001)
    ]


SPOILT = (
    (nan_position, -1, "point 1 joint 3 position is not finite"),
    (infinite_velocity, -1, "point 0 joint 0 velocity is not finite"),
    (unknown_joint, -2, "joint_a7"),
    (missing_joint, -2, "joint_a6"),
    (double_joint, -2, "joint_a1"),
    (no_names, -1, "no joint names"),
    (no_points, -1, "no points"),
    (short_positions, -1, "point 1 has 5 positions"),
    (long_velocities, -1, "point 1 has 7 velocities"),
    (equal_times, -1, "point 1"),
    (negative_time, -1, "negative"),
    (nanoseconds_of_a_second, -1, "nanosec"),
    (with_effort, -1, "effort"),
    (with_multi_dof, -1, "multi_dof"),
    (old_stamp, -3, "ago"),
    (strange_tolerance, -1, "tolerance of joint_a1"),
    (many_points, -1, "20001 points"),
)


def test_spoilt_goals_are_aborted_with_code_and_sentence(client):
    wrong = []
    for spoil, code, word in SPOILT:
        goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(movement()))
        for point in goal.trajectory.points:  # lists can be spoilt, arrays less easily
            point.positions = list(point.positions)
            point.velocities = list(point.velocities)
            point.accelerations = list(point.accelerations)
        spoil(goal)
        result = client.send_goal(names.EXECUTE_TRAJECTORY, goal, timeout=PATIENCE)
        if result.error_code != code or word not in result.error_string:
            wrong.append(f"{spoil.__name__}: {result.error_code}, {result.error_string}")
    assert wrong == []
    assert client.execute(movement(), timeout=PATIENCE).energy > 0.0  # and the next one runs


def test_a_bad_trajectory_on_the_topic_is_reported_in_diagnostics(client, ros_node, wait_for):
    received = []
    ros_node.create_subscription(DiagnosticArray, names.DIAGNOSTICS, received.append, 10)
    publisher = ros_node.create_publisher(JointTrajectoryMsg, names.COMMANDED_TRAJECTORY, 10)
    wait_for(lambda: publisher.get_subscription_count() > 0)
    publisher.publish(JointTrajectoryMsg(joint_names=["elbow"]))

    def reported():
        return any("no points" in status.message for msg in received for status in msg.status)

    wait_for(reported)


def test_a_huge_trajectory_on_the_topic_is_refused_by_its_bytes(client, ros_node, wait_for):
    received = []
    ros_node.create_subscription(DiagnosticArray, names.DIAGNOSTICS, received.append, 10)
    publisher = ros_node.create_publisher(JointTrajectoryMsg, names.COMMANDED_TRAJECTORY, 10)
    wait_for(lambda: publisher.get_subscription_count() > 0)
    publisher.publish(JointTrajectoryMsg(joint_names=["j" * 6_000_000]))

    def reported():
        return any("bytes: at most" in status.message for msg in received for status in msg.status)

    wait_for(reported)
    assert client.execute(movement(), timeout=PATIENCE).energy > 0.0


def test_a_trajectory_on_the_topic_runs_and_overrides_the_action(client, ros_node, wait_for):
    states = []
    ros_node.create_subscription(JointState, names.JOINT_STATES, states.append, 100)
    publisher = ros_node.create_publisher(JointTrajectoryMsg, names.COMMANDED_TRAJECTORY, 10)
    wait_for(lambda: publisher.get_subscription_count() > 0)
    cell = load_cell("open")
    target = np.array(cell.machine_home) - 0.02
    override = JointTrajectory.from_seconds(
        cell.robot.joint_names, [2.0], target[None], np.zeros((1, 6))
    )
    sent = []

    def send_once(feedback):
        if not sent:
            sent.append(feedback)
            publisher.publish(trajectory_to_msg(override))

    with pytest.raises(RequestRefusedError, match="preempted"):
        client.execute(movement(0.2, 60.0), feedback=send_once, timeout=PATIENCE)
    wait_for(lambda: states and np.allclose(states[-1].position, target, atol=1e-6))


def test_a_cancelled_goal_comes_back_canceled(client, ros_node, wait_for):
    from action_msgs.msg import GoalStatus
    from rclpy.action import ActionClient

    action = ActionClient(client.node, ExecuteTrajectory, names.EXECUTE_TRAJECTORY)
    run = client._executor.run
    wait_for(action.server_is_ready)
    handles = []
    results = []
    goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(movement(0.2, 60.0)))

    def send():
        action.send_goal_async(goal).add_done_callback(
            lambda future: handles.append(future.result())
        )

    run(send)
    wait_for(lambda: handles)
    run(
        lambda: (
            handles[0]
            .get_result_async()
            .add_done_callback(lambda future: results.append(future.result()))
        )
    )
    run(lambda: handles[0].cancel_goal_async())
    wait_for(lambda: results)
    assert results[0].status == GoalStatus.STATUS_CANCELED
    run(lambda: handles[0].cancel_goal_async())  # after the end: harmless
    run(action.destroy)
    assert client.ask(names.QUERY_MODES, QueryModes.Request()).modes


def test_a_log_gets_so_many_lines_a_second_and_no_more(driver, ros_executor, monkeypatch):
    """A second ends where the driver looks: before all this, and after it."""
    lines = []

    def chatter():
        driver._publish_diagnostics()
        monkeypatch.setattr(driver, "_log", lines.append)
        for k in range(150):
            driver._driver.warn(f"line {k}")
        driver._publish_diagnostics()

    ros_executor.run(chatter)
    assert len(lines) == node._LINES_MAX
    assert "more messages" in lines[-1].sentence


def test_any_speed_scaling_is_survived(client, ros_node, wait_for):
    publisher = ros_node.create_publisher(Float64, names.SPEED_SCALING, 10)
    wait_for(lambda: publisher.get_subscription_count() > 0)
    for factor in (float("nan"), -1.0, float("inf"), 10.0):
        publisher.publish(Float64(data=factor))
    assert client.execute(movement(), timeout=PATIENCE).energy > 0.0


def test_an_unknown_bit_lists_the_known_and_an_unknown_mode_changes_nothing(
    client, ros_node, wait_for
):
    with pytest.raises(RequestRefusedError, match=r"known are .*emergency_stop"):
        client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="turbo", value=True))
    publisher = ros_node.create_publisher(PlcInputs, names.PLC_INPUTS, LATCHED)
    publisher.publish(PlcInputs(operating_mode=77))
    assert client.execute(movement(), timeout=PATIENCE).energy > 0.0


def test_a_pause_that_means_nothing_is_refused(client):
    for pause in (float("nan"), -1.0, 0.0):
        with pytest.raises(RequestRefusedError, match="pause is"):
            client.ask(names.START_PAUSE, StartPause.Request(pause=pause))


@pytest.mark.parametrize(
    ("name", "value", "accepted"),
    [
        ("execution.tube", 0.004, True),
        ("execution.tube", -1.0, False),
        ("execution.tube", float("nan"), False),
        ("mac", "02:00:00:c4:02:11", False),
        ("backend", "pybullet", False),
    ],
)
def test_parameters_keep_their_range_and_what_is_fixed_stays(driver, client, name, value, accepted):
    before = driver.get_parameter(name).value
    result = client._executor.run(lambda: driver.set_parameters([Parameter(name, value=value)])[0])
    assert result.successful == accepted
    assert driver.get_parameter(name).value == (value if accepted else before)
    assert accepted or result.reason


def test_a_port_that_is_taken_leaves_the_node_running(driver, ros_context, ros_executor):
    second = SimDriver(
        context=ros_context,
        namespace="other",
        parameter_overrides=[
            Parameter(name, value=value)
            for name, value in {
                "cell": "open",
                "backend": "ideal",
                "wake_port": driver.port_of("wake_on_lan"),
            }.items()
        ],
    )
    ros_executor.add_node(second)
    assert second.port_of("wake_on_lan") == 0
