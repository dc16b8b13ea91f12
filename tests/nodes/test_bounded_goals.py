"""Goals of more points than may be are refused before Python objects are made of the points."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import JointTrajectoryPoint, MultiDOFJointTrajectoryPoint

from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import JointTolerance
from ir_msgs_py.ros.topics import ACTION_SERVICES
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.node import SimDriver, bounded_goals, node
from ir_sim_driver.node.messages import goal_from_action

MOST = 10


def goal(points: int, multi_dof: int = 0) -> ExecuteTrajectory.Goal:
    sent = ExecuteTrajectory.Goal(trajectory_id="counted")
    sent.trajectory.joint_names = [f"joint_a{k}" for k in range(1, 7)]
    sent.trajectory.points = [JointTrajectoryPoint(positions=[0.5] * 6) for _ in range(points)]
    sent.multi_dof_trajectory.points = [MultiDOFJointTrajectoryPoint() for _ in range(multi_dof)]
    return sent


def taken(sent: ExecuteTrajectory.Goal, most: int) -> tuple[Any, str, list[tuple[int, int]]]:
    """A request as the server converts it, why it is refused, and what was asked: points, bytes."""
    from rclpy.impl.implementation_singleton import rclpy_implementation

    kind = ExecuteTrajectory.Impl.SendGoalService.Request
    asked: list[tuple[int, int]] = []

    def admit(points: int, size: int, sent: int) -> bounded_goals.Admission:
        assert sent == 0  # a request that no server took has no time
        asked.append((points, size))
        if points > most:
            return bounded_goals.Admission(refusal=f"{points} points")
        return bounded_goals.Admission(7)

    counted = bounded_goals._CountedRequest(kind, admit, lambda goal_id: False)
    request = kind(goal=sent)
    request.goal_id.uuid[:] = range(16)
    made = rclpy_implementation.rclpy_deserialize(serialize_message(request), counted.as_class)
    return made, counted.admission.refusal, asked


def test_a_goal_within_the_bound_is_whole() -> None:
    request, refusal, asked = taken(goal(MOST), MOST)
    assert refusal == ""
    assert asked == [(MOST, MOST * 6 * 8)]
    assert request.goal == goal(MOST)
    assert list(request.goal_id.uuid) == list(range(16))


@pytest.mark.parametrize(
    ("points", "multi_dof"), [(MOST + 1, 0), (5000, 0), (2, MOST + 1), (0, 5000)]
)
def test_beyond_it_all_but_the_points_are_there(points: int, multi_dof: int) -> None:
    for _ in range(3):  # the points are freed, too
        request, refusal, _ = taken(goal(points, multi_dof), MOST)
    assert f"{multi_dof or points} points" in refusal
    assert not request.goal.trajectory.points
    assert not request.goal.multi_dof_trajectory.points
    assert request.goal == goal(0)


def test_other_threads_run_while_a_long_goal_is_converted() -> None:
    """A press of the emergency stop does not wait for the 0.2 s that 20,000 points take."""
    message = goal(20_000).trajectory
    data = serialize_message(message)
    looks: list[float] = []
    ended = threading.Event()

    def look() -> None:
        while not ended.is_set():
            looks.append(time.monotonic())
            time.sleep(0.0005)

    reader = bounded_goals.TrajectoryReader()
    other = threading.Thread(target=look)
    other.start()
    began = time.monotonic()
    read = reader.read(data)
    seconds = time.monotonic() - began
    ended.set()
    other.join()
    within = [each for each in looks if began <= each <= began + seconds]
    assert read == message
    assert len(within) > 10  # in one piece: 1 or 2


@pytest.mark.parametrize("name", ["path_tolerance", "goal_tolerance"])
def test_a_goal_of_many_tolerances_is_refused_before_they_are_converted(name: str) -> None:
    sent = goal(2)
    setattr(sent, name, [JointTolerance(name="joint_a1")] * 5000)
    request, refusal, _ = taken(sent, MOST)
    assert "5000" in refusal
    assert not getattr(request.goal, name)


def test_the_driver_refuses_it_with_the_count_and_forgets_it_soon(
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    wait_for: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert node._RESULT_KEPT <= 60
    monkeypatch.setattr(node, "_RESULT_KEPT", 1)
    overrides = [Parameter("cell", value="open"), Parameter("backend", value="ideal")]
    overrides += [Parameter("wake_port", value=0), Parameter("execution.max_points", value=MOST)]
    driver = ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    client = ros_executor.run(
        lambda: ActionClient(
            ros_node, ExecuteTrajectory, "/ir_sim_driver/execute_trajectory", **ACTION_SERVICES
        )
    )
    wait_for(client.server_is_ready, what="execute_trajectory is offered")
    server = driver._actions[0]
    sent = ros_executor.run(lambda: client.send_goal_async(goal(3000)))
    wait_for(sent.done, what="the goal is taken")
    result = ros_executor.run(lambda: sent.result().get_result_async())
    wait_for(result.done, what="the goal ends")
    answer = result.result().result
    assert answer.error_code == ExecuteTrajectory.Result.INVALID_GOAL
    assert f"the trajectory has 3000 points: at most {MOST}" in answer.error_string
    wait_for(lambda: not server._goal_handles, what="goal and result are forgotten")


def test_a_goal_knows_one_last_stop() -> None:
    """A step of a program may name one, and the runner names the one that it knows."""
    sent = goal(2)
    sent.trajectory.points[1].time_from_start.sec = 1
    sent.states = ["driver.stops=5", "lathe=door_open", "driver.stops=5"]
    read = goal_from_action(sent, MOST)
    assert (read.after_stop, read.states) == (5, ("lathe=door_open",))
    sent.states = ["driver.stops=5", "driver.stops=7"]
    with pytest.raises(TrajectoryRefusedError, match=r"driver\.stops is 5 and 7: a goal knows one"):
        goal_from_action(sent, MOST)
