"""Many requests at once: each is answered, quick ones at once, and what is too much is refused in
words.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState

from ir_description import Cell
from ir_msgs.action import Plan
from ir_msgs.msg import PlanOptions, Status
from ir_msgs.srv import CheckState, PlanRegionalMovement, SetCell
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.spinning import Cancellation
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import ACTION_SERVICES, REQUESTS_WAITING, SERVICE
from ir_planner.errors import CancelledError
from ir_planner.node import node as planner_module
from ir_planner.node.node import PlannerNode
from ir_values.errors import CallGivenUpError

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
STATE = JointState(name=[f"joint_a{k}" for k in range(1, 7)], position=list(HOME))
MANY = 100  # ten times what ROS keeps by default
CANCELLED = 5  # action_msgs/GoalStatus.STATUS_CANCELED


@pytest.fixture
def send(
    planner_node: PlannerNode, ros_node: Any, ros_executor: Any, wait_for: Any
) -> Callable[[int], list[Any]]:
    """Send goals of the plan action; their accepted handles."""
    client = ros_executor.run(
        lambda: ActionClient(ros_node, Plan, "/ir_planner/plan", **ACTION_SERVICES)
    )
    wait_for(client.server_is_ready, what="plan is offered")

    def goals(count: int) -> list[Any]:
        goal = Plan.Goal(
            stations=["park"], savings=False, options=PlanOptions(planning_time=PATIENCE)
        )
        futures = [ros_executor.run(lambda: client.send_goal_async(goal)) for _ in range(count)]
        wait_for(lambda: all(future.done() for future in futures), what="goals are accepted")
        return [future.result() for future in futures]

    return goals


@pytest.fixture
def go_on(planner_node: PlannerNode, monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Plans begin when this is set: what a test does before comes before their end."""
    event = threading.Event()
    plan = planner_node.planner.plan_program

    def later(**asked: Any) -> Any:
        while not (event.wait(0.005) or asked["cancelled"]()):
            pass
        return plan(**asked)

    monkeypatch.setattr(planner_node.planner, "plan_program", later)
    yield event
    event.set()


def test_eight_plans_hold_up_no_quick_request_and_all_end(
    send: Callable[[int], list[Any]],
    call: Callable[..., Any],
    ros_executor: Any,
    wait_for: Any,
    go_on: threading.Event,
) -> None:
    results = [ros_executor.run(goal.get_result_async) for goal in send(8)]
    assert call(CheckState, "check_state", state=STATE).valid
    assert not any(future.done() for future in results)
    go_on.set()
    assert call(CheckState, "check_state", state=STATE).valid
    wait_for(lambda: all(future.done() for future in results), what="all plans end")
    programs = {future.result().result.program_id for future in results}
    assert {future.result().result.status.code for future in results} == {Status.SUCCESS}
    assert len(programs) == 1


def test_a_plan_that_waits_is_cancelled_at_once(
    send: Callable[[int], list[Any]], ros_executor: Any, wait_for: Any, go_on: threading.Event
) -> None:
    first, *_, last = send(3)
    answer = ros_executor.run(last.get_result_async)
    ros_executor.run(last.cancel_goal_async)
    wait_for(answer.done, what="the cancelled goal ends")
    assert answer.result().status == CANCELLED
    assert answer.result().result.status.code == Status.PREEMPTED
    go_on.set()
    others = [ros_executor.run(goal.get_result_async) for goal in (first, *_)]
    wait_for(lambda: all(future.done() for future in others), what="the others end")
    assert {future.result().result.status.code for future in others} == {Status.SUCCESS}


def test_a_plan_that_its_client_gave_up_ends_and_nobody_elses(
    planner_node: PlannerNode,
    call: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    ros_context: Any,
    wait_for: Any,
) -> None:
    """It would be planned for as long as the test has patience, and hold up the next."""
    begun: list[str] = []
    ended: list[str] = []
    plan = planner_node.planner.plan_regional
    given_up = Cancellation()

    def endless(*, goal: Any, cancelled: Callable[[], bool], **asked: Any) -> Any:
        begun.append(goal.text)
        if goal.text == "park":
            wait_for(cancelled, what="its client is gone")
            ended.append(goal.text)
            raise CancelledError("stopped on request")
        return plan(goal=goal, cancelled=cancelled, **asked)

    def ask() -> Any:
        with Client(context=ros_context, node_name="impatient") as client:
            name = "ir_planner/plan_regional_movement"
            request = PlanRegionalMovement.Request(goal="park", start=STATE)
            return client.call(name, request, PATIENCE, given_up)

    monkeypatch.setattr(planner_node.planner, "plan_regional", endless)
    with ThreadPoolExecutor() as pool:
        first = pool.submit(ask)
        wait_for(lambda: begun or first.done(), what="it is planned")
        assert not first.done(), first.result()
        other = pool.submit(
            call, PlanRegionalMovement, "plan_regional_movement", goal="home", start=STATE
        )
        assert not ended
        given_up.cancel()
        assert isinstance(first.exception(PATIENCE), CallGivenUpError)
        assert other.result(PATIENCE).status.code == Status.SUCCESS
    assert ended == ["park"]


def test_more_plans_than_may_wait_are_refused_in_words(
    send: Callable[[int], list[Any]],
    planner_node: PlannerNode,
    ros_executor: Any,
    wait_for: Any,
    go_on: threading.Event,
) -> None:
    planner_node._goals._most = 1
    results = [ros_executor.run(goal.get_result_async) for goal in send(4)]
    wait_for(lambda: sum(future.done() for future in results) == 2, what="two goals are refused")
    go_on.set()
    wait_for(lambda: all(future.done() for future in results), what="all goals end")
    statuses = [future.result().result.status for future in results]
    assert [status.code for status in statuses].count(Status.SUCCESS) == 2
    refused = [status.message for status in statuses if status.code != Status.SUCCESS]
    assert all("wait already" in sentence for sentence in refused)
    assert planner_module._GOALS_WAITING > 1


@pytest.mark.usefixtures("go_on")
def test_a_hundred_cancels_are_all_answered(
    send: Callable[[int], list[Any]], ros_executor: Any, wait_for: Any
) -> None:
    goal = send(1)[0]
    answer = ros_executor.run(goal.get_result_async)
    cancels = [ros_executor.run(goal.cancel_goal_async) for _ in range(MANY)]
    wait_for(lambda: all(cancel.done() for cancel in cancels), what="cancels are answered")
    wait_for(answer.done, what="the goal ends")
    assert answer.result().status == CANCELLED


@pytest.mark.long
def test_a_large_cell_holds_up_no_quick_request(
    planner_node: PlannerNode,
    ros_node: Any,
    ros_executor: Any,
    wait_for: Any,
    call: Callable[..., Any],
) -> None:
    """Nor when reading it takes for ever."""
    read = planner_node.planner._current._read
    go_on = threading.Event()

    def held_up(text: str, name: str) -> Cell:
        cell = read(text, name)
        go_on.wait(PATIENCE)
        return cell

    planner_node.planner._current._read = held_up
    client = ros_executor.run(lambda: ros_node.create_client(SetCell, "/ir_planner/set_cell"))
    wait_for(client.service_is_ready, what="set_cell is offered")
    loading = ros_executor.run(
        lambda: client.call_async(SetCell.Request(cell_yaml=large_cell(3000)))
    )
    for _ in range(3):
        assert call(CheckState, "check_state", state=STATE).status.code == Status.SUCCESS
    assert not loading.done()
    go_on.set()
    wait_for(loading.done, what="the cell is there")
    assert loading.result().status.code == Status.SUCCESS, loading.result().status.message
    assert planner_node.planner.cell.name == "large"


def large_cell(bodies: int) -> str:
    """A cell of many small boxes, two metres before the robot."""
    head = (
        "format: ir_cell/1\nname: large\nrobot: kr210_r2700_extra\nequipment:\n- name: m\n  "
        "bodies:\n"
    )
    row = "  - {{name: b{0}, kind: box, size: [0.01, 0.01, 0.01], xyz: [{1:.2f}, {2:.2f}, 0.02]}}"
    return head + "\n".join(
        row.format(k, 3.0 + 0.02 * (k % 100), 0.02 * (k // 100)) for k in range(bodies)
    )


@pytest.mark.long  # test_serving.py has the same with fewer requests
def test_as_many_calls_at_once_as_may_wait_are_all_answered(
    planner_node: PlannerNode, ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    clients = [
        ros_executor.run(
            lambda: ros_node.create_client(
                CheckState, "/ir_planner/check_state", qos_profile=SERVICE
            )
        )
        for _ in range(20)
    ]
    for client in clients:
        wait_for(client.service_is_ready, what="check_state is offered")
    begin = time.monotonic()
    futures = [
        ros_executor.run(lambda c=client: c.call_async(CheckState.Request(state=STATE)))
        for _ in range(REQUESTS_WAITING // len(clients))
        for client in clients
    ]
    wait_for(lambda: all(future.done() for future in futures), what="all are answered")
    assert all(future.result().valid for future in futures), time.monotonic() - begin
