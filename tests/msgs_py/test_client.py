"""The client of scripts: answers, refusals, timeouts and goals, against nodes in this process."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from rclpy.action import ActionClient, CancelResponse
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile

from ir_msgs.action import ExecuteTrajectory, RunProgram
from ir_msgs.msg import PowerState, Station, Status
from ir_msgs.srv import GetTrajectory, SetCell
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.ros import client as client_module
from ir_msgs_py.ros import rclpy_inside
from ir_msgs_py.ros import spinning as spinning_module
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.rclpy_inside import PatientActionServer
from ir_msgs_py.ros.spinning import Cancellation
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.waiting import Waiting
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.errors import (
    CallGivenUpError,
    CallTimedOutError,
    RequestRefusedError,
    ServiceUnavailableError,
)

TRAJECTORY = JointTrajectory(JOINT_NAMES, [0, 10**9], np.zeros((2, 6)))


class FakeCell(Node):
    """Answers as planner, runner and driver would, at once."""

    def __init__(self, context):
        super().__init__("cell", context=context)
        self.waiting = Waiting(self)
        self.canceled = threading.Event()
        self.create_service(SetCell, "ir_planner/set_cell", self.set_cell)
        self.create_service(GetTrajectory, "ir_planner/get_trajectory", self.get_trajectory)
        self.runner = PatientActionServer(
            self,
            RunProgram,
            "ir_program_runner/run_program",
            self.run_program,
            cancel_callback=self.cancel,
        )
        PatientActionServer(
            self, ExecuteTrajectory, "ir_sim_driver/execute_trajectory", self.execute
        )
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_publisher(PowerState, "meter", kept).publish(PowerState(power=420.0))

    def set_cell(self, request, response):
        known = request.cell_file == "demo" or "\n" in request.cell_yaml
        response.status = (
            Status(code=1) if known else Status(code=-19, message='cell "mars": known are demo')
        )
        response.stations = [Station(name="lathe"), Station(name="table")]
        return response

    def get_trajectory(self, request, response):
        response.status = Status(code=1)
        response.trajectory = trajectory_to_msg(TRAJECTORY)
        return response

    def cancel(self, goal_handle):
        self.canceled.set()
        return CancelResponse.ACCEPT

    async def run_program(self, goal_handle):
        goal_handle.publish_feedback(RunProgram.Feedback(movement=1, total=2, phase="moving"))
        if goal_handle.request.program_id == "endless":
            await self.waiting.until(lambda: goal_handle.is_cancel_requested)
            goal_handle.canceled()
            return RunProgram.Result(status=Status(code=-7))
        goal_handle.succeed()
        return RunProgram.Result(status=Status(code=1), executed=2, duration=3.0, energy=400.0)

    def execute(self, goal_handle):
        if goal_handle.request.trajectory_id != TRAJECTORY.trajectory_id:
            goal_handle.abort()
            return ExecuteTrajectory.Result(
                error_code=-1, error_string="point 0 joint 0 position is not finite"
            )
        goal_handle.succeed()
        return ExecuteTrajectory.Result(max_tool_deviation=0.001, energy=12.0)


@pytest.fixture
def cell(ros_context, ros_executor):
    return ros_executor.add_node(FakeCell(ros_context))


@pytest.fixture
def client(cell, ros_context, monkeypatch):
    monkeypatch.setattr(client_module, "_CANCEL_GRACE", 60.0)  # s: a busy machine
    with Client(context=ros_context, timeout=PATIENCE) as client:
        yield client


class TestOnAContextOfItsOwn:
    @pytest.fixture
    def ros_discovery_range(self):
        return (
            "SYSTEM_DEFAULT"  # two contexts are two participants: without discovery they never meet
        )

    def test_the_cell_is_found(self, cell, ros_domain_id):
        with Client(domain_id=ros_domain_id, timeout=PATIENCE) as client:
            assert client.set_cell("demo") == ("lathe", "table")


def test_a_request_is_answered(client):
    assert client.set_cell("demo") == ("lathe", "table")
    assert client.set_cell("name: demo\n") == ("lathe", "table")
    assert client.get_trajectory("id") == TRAJECTORY


def test_a_refusal_raises_its_sentence_and_code(client):
    with pytest.raises(
        RequestRefusedError, match=r'INVALID_OBJECT_NAME.*cell "mars": known are demo'
    ) as caught:
        client.set_cell("mars")
    assert caught.value.code == -19
    response = client.call("/ir_planner/set_cell", SetCell.Request(cell_file="mars"))
    assert response.status.code == -19


def test_a_call_of_a_service_that_nobody_offers_can_be_given_up(client):
    given_up = Cancellation()
    given_up.cancel()
    with pytest.raises(CallGivenUpError):
        client.call("/nowhere", SetCell.Request(), timeout=PATIENCE, give_up=given_up)


@pytest.fixture
def seldom_looking(monkeypatch):
    """Waits look at nothing until they are woken, or the test has no patience left."""
    monkeypatch.setattr(spinning_module, "_SLICE", PATIENCE)
    monkeypatch.setattr(client_module, "GONE", 10.0 * PATIENCE)


@pytest.mark.usefixtures("seldom_looking")
def test_a_goal_that_is_given_up_is_canceled_at_that_moment(client, cell):
    given_up = Cancellation()
    begun = time.monotonic()
    with pytest.raises(RequestRefusedError) as caught:
        client.run_program("endless", progress=lambda at: given_up.cancel(), give_up=given_up)
    assert caught.value.code == -7
    assert cell.canceled.is_set()
    assert time.monotonic() - begun < 0.5 * PATIENCE


@pytest.mark.usefixtures("seldom_looking")
def test_a_call_that_is_given_up_ends_at_that_moment(client, cell, ros_executor):
    given_up = Cancellation()
    go_on = threading.Event()

    def give_up(request, response):
        given_up.cancel()
        go_on.wait(PATIENCE)
        return response

    ros_executor.run(lambda: cell.create_service(SetCell, "silent", give_up))
    begun = time.monotonic()
    with pytest.raises(CallGivenUpError, match="the call of /silent was given up"):
        client.call("/silent", SetCell.Request(), timeout=PATIENCE, give_up=given_up)
    assert time.monotonic() - begun < 0.5 * PATIENCE
    go_on.set()


def test_a_result_that_was_lost_is_asked_for_again(client, cell, monkeypatch):
    """As where the client was suspended until the middleware had forgotten it."""
    monkeypatch.setattr(client_module, "GONE", 1.0)  # looks more often
    handle = cell.runner._handle
    send = type(handle).send_result_response
    lost = []

    def lose(self, header, response):
        if lost:
            send(self, header, response)
        else:
            lost.append(response)

    monkeypatch.setattr(type(handle), "send_result_response", lose)
    result = client.send_goal("/ir_program_runner/run_program", RunProgram.Goal(program_id="short"))
    assert lost
    assert result == lost[0].result


def test_a_goal_whose_answer_was_lost_is_canceled_by_its_id(client, cell, monkeypatch):
    answer = rclpy_inside.GoalRequests.answer
    client.send_goal("/ir_program_runner/run_program", RunProgram.Goal(program_id="short"))
    monkeypatch.setattr(rclpy_inside.GoalRequests, "answer", lambda self, header, response: None)
    monkeypatch.setattr(client, "timeout", 2.0)
    with pytest.raises(CallTimedOutError, match="did not take the goal within 2 s"):
        client.send_goal("/ir_program_runner/run_program", RunProgram.Goal(program_id="endless"))
    assert cell.canceled.wait(PATIENCE)
    monkeypatch.setattr(rclpy_inside.GoalRequests, "answer", answer)
    client.send_goal("/ir_program_runner/run_program", RunProgram.Goal(program_id="short"))


def test_a_goal_whose_node_was_started_anew_ends(client, cell, monkeypatch):
    """The new one is there before the old one is forgotten, and does not know the goal."""
    monkeypatch.setattr(client_module, "GONE", 1.0)  # looks more often
    monkeypatch.setattr(client_module, "FORGOTTEN", 2.0)

    def start_anew(at):
        cell.runner._goal_handles.clear()

    with pytest.raises(RequestRefusedError, match="does not know the goal any more"):
        client.send_goal(
            "/ir_program_runner/run_program", RunProgram.Goal(program_id="endless"), start_anew
        )


def test_a_goal_that_its_node_does_not_know_any_more_is_no_success(client, cell, monkeypatch):
    def forget(self, taken):
        self._goal_handles.clear()
        return forgotten(self, taken)

    forgotten = PatientActionServer._execute_get_result_request
    monkeypatch.setattr(PatientActionServer, "_execute_get_result_request", forget)
    with pytest.raises(RequestRefusedError, match="does not know the goal any more"):
        client.send_goal("/ir_program_runner/run_program", RunProgram.Goal(program_id="endless"))


def test_a_cancellation_calls_back_once_and_only_while_somebody_waits():
    called = []
    cancellation = Cancellation()
    with cancellation.calling(lambda: called.append("gone")):
        pass
    with cancellation.calling(lambda: called.append("waits")):
        assert not cancellation.canceled
        cancellation.cancel()
        cancellation.cancel()
        assert called == ["waits"]
    with cancellation.calling(lambda: called.append("late")):
        assert called == ["waits", "late"]


def test_a_service_that_nobody_offers_is_named(client):
    with pytest.raises(
        ServiceUnavailableError, match=r"no node offers the service /nowhere \(waited 0.05 s\)"
    ):
        client.call("/nowhere", SetCell.Request(), timeout=0.05)


def test_a_service_that_does_not_answer_is_named(client, cell, ros_executor):
    heard = threading.Event()

    def stay_silent(request, response):
        heard.wait(PATIENCE)
        return response

    ros_executor.run(lambda: cell.create_service(SetCell, "silent", stay_silent))
    with pytest.raises(CallTimedOutError, match=r"/silent did not answer within 0\.3 s"):
        client.call("/silent", SetCell.Request(), timeout=0.3)
    heard.set()


def test_a_program_is_run_with_its_progress(client):
    phases = []
    run = client.run_program("abc", progress=lambda at: phases.append(at.phase))
    assert (run.executed, run.duration, run.energy) == (2, 3.0, 400.0)
    assert phases == ["moving"]


def test_a_goal_that_takes_too_long_is_canceled(client, cell):
    with pytest.raises(
        CallTimedOutError, match=r"had no result within 0.1 s: the goal was canceled"
    ):
        client.run_program("endless", timeout=0.1)
    assert cell.canceled.is_set()


def test_a_goal_whose_node_dies_is_given_up(client, cell, ros_executor, monkeypatch):
    monkeypatch.setattr(client_module, "GONE", 0.1)
    with pytest.raises(
        ServiceUnavailableError, match=r"that ran ir_program_runner/run_program has gone"
    ):
        client.run_program("endless", progress=lambda at: ros_executor.run(cell.runner.destroy))


def test_a_goal_outlasts_a_suspension_of_its_client(client, cell, monkeypatch):
    """The first look afterwards finds nobody, as the middleware has forgotten both; the next one
    finds the node again. A goal that were given up then would go on without anybody.
    """
    monkeypatch.setattr(client_module, "GONE", 1.0)  # looks more often
    given_up = Cancellation()
    ahead = [0.0]
    looks = []

    class Clock:
        @staticmethod
        def monotonic():
            return time.monotonic() + ahead[0]

    def is_ready(self):
        looks.append(self)
        if len(looks) == 1:
            ahead[0] = 60.0
        if len(looks) == 3:
            given_up.cancel()  # a test has no other way to an end
        return len(looks) != 2

    def suspend(at):
        monkeypatch.setattr(ActionClient, "server_is_ready", is_ready)

    monkeypatch.setattr(client_module, "time", Clock)
    with pytest.raises(RequestRefusedError) as caught:
        client.run_program("endless", progress=suspend, give_up=given_up)
    assert caught.value.code == -7
    assert cell.canceled.is_set()
    assert len(looks) >= 3


def test_a_failing_progress_callback_reaches_the_script_and_cancels_the_goal(
    client, cell, wait_for
):
    def fail(at):
        raise KeyError("my own mistake")

    with pytest.raises(KeyError, match="my own mistake"):
        client.run_program("endless", progress=fail)
    assert cell.canceled.is_set()


def test_a_trajectory_is_driven_or_refused(client):
    assert client.execute(TRAJECTORY).max_tool_deviation == 0.001
    other = JointTrajectory(JOINT_NAMES, [0, 2 * 10**9], np.zeros((2, 6)))
    with pytest.raises(
        RequestRefusedError, match="point 0 joint 0 position is not finite"
    ) as caught:
        client.execute(other)
    assert caught.value.code == -1


def test_a_kept_message_is_heard_later(client):
    assert client.next_message("/meter", PowerState).power == 420.0
    with pytest.raises(CallTimedOutError, match=r"no message on /silence within 0.05 s"):
        client.next_message("/silence", PowerState, timeout=0.05)


def test_of_several_kept_messages_the_newest_is_given(client, cell, wait_for):
    kept = QoSProfile(history=HistoryPolicy.KEEP_ALL, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = cell.create_publisher(PowerState, "/events", kept)
    for power in range(50):
        publisher.publish(PowerState(power=float(power)))
    assert client.next_message("/events", PowerState).power == 49.0
    wait_for(lambda: publisher.get_subscription_count() == 0)


def test_the_graph_names_services_actions_and_topics(client, wait_for):
    wait_for(lambda: "/ir_planner/set_cell" in client.graph.services())
    assert client.graph.services()["/ir_planner/set_cell"] == "ir_msgs/srv/SetCell"
    assert client.graph.actions()["/ir_program_runner/run_program"] == "ir_msgs/action/RunProgram"
    assert client.graph.topics()["/meter"] == "ir_msgs/msg/PowerState"
    assert not any("_action" in name for name in client.graph.services())
