"""`ir ros send_goal` and `ir ros cancel` against a real action."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.action import CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node

from ir_cli.main import main
from ir_msgs.action import RunProgram
from ir_msgs_py.ros.rclpy_inside import PatientActionServer
from ir_msgs_py.ros.testing import PATIENCE, WaitFor

ACTION = "/machine/run"


class Machine:
    """An action that ends at once for the program "short", else when it is canceled."""

    def __init__(self, context: Context) -> None:
        self.node = Node("machine", context=context)
        self.running = threading.Event()
        self.ended = threading.Event()
        self.server = PatientActionServer(
            self.node,
            RunProgram,
            ACTION,
            self.run,
            callback_group=ReentrantCallbackGroup(),
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    def run(self, goal: ServerGoalHandle) -> Any:
        while not self.node.count_subscribers(f"{ACTION}/_action/feedback"):
            self.ended.wait(0.005)  # who sent the goal may be found a moment after it
        goal.publish_feedback(RunProgram.Feedback(phase="moving", total=3))
        result = RunProgram.Result(executed=3)
        if goal.request.program_id == "short":
            result.status.code = 1
            goal.succeed()
            return result
        self.running.set()
        while not (goal.is_cancel_requested or self.ended.wait(0.01)):
            pass
        result.status.code = -7
        result.status.message = "canceled"
        goal.canceled()
        return result


@pytest.fixture
def ros_discovery_range() -> str:
    """The commands have a participant of their own, which has to find the machine."""
    return "SYSTEM_DEFAULT"


@pytest.fixture
def machine(
    ros_context: Context, ros_domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Machine]:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
    machine = Machine(ros_context)
    executor = MultiThreadedExecutor(num_threads=4, context=ros_context)
    executor.add_node(machine.node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    yield machine
    machine.ended.set()
    executor.shutdown()
    spinning.join(60.0)
    machine.server.destroy()
    machine.node.destroy_node()


def test_a_goal_is_sent_and_its_result_printed(
    machine: Machine, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ros", "send_goal", ACTION, "{program_id: short}", "--feedback"]) == 0
    printed = capsys.readouterr().out
    assert "phase: moving" in printed
    assert "executed: 3" in printed


def test_another_process_cancels_what_runs(
    machine: Machine, capsys: pytest.CaptureFixture[str]
) -> None:
    codes: list[int] = []

    def send() -> None:
        # signals belong to the main thread: the goal is sent below main()
        from ir_cli.ros.graph import run_send_goal

        arguments = type("Arguments", (), {})()
        arguments.action = ACTION
        arguments.values = ["{program_id: long}"]
        arguments.full = False
        arguments.feedback = False
        arguments.timeout = PATIENCE
        codes.append(run_send_goal(arguments))

    sender = threading.Thread(target=send)
    sender.start()
    assert machine.running.wait(PATIENCE)
    assert main(["ros", "cancel", ACTION]) == 0
    sender.join(60.0)
    assert codes == [1]
    printed = capsys.readouterr().out
    assert f"1 goal of {ACTION} will end" in printed
    assert "canceled" in printed


def test_nothing_to_cancel_is_said(machine: Machine, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ros", "cancel", ACTION]) == 1
    assert "has no goal to cancel" in capsys.readouterr().err


def test_a_misspelt_action_is_answered_with_the_one_that_was_meant(
    machine: Machine, capsys: pytest.CaptureFixture[str], wait_for: WaitFor
) -> None:
    def answered() -> bool:
        assert main(["ros", "send_goal", "/machine/rum", "{}"]) == 1
        return f"did you mean {ACTION}?" in capsys.readouterr().err

    wait_for(answered, what="the name that was meant")
