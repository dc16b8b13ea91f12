"""`ir ros front` against an action that answers as the planner does."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rclpy.action.server import ServerGoalHandle
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from ir_cli.main import main
from ir_msgs.action import Plan
from ir_msgs.msg import ProgramPoint, ProgramSavings, Saving
from ir_msgs_py import names
from ir_msgs_py.ros.rclpy_inside import PatientActionServer


class Planner:
    """A planner of one program; remembers what it was asked."""

    def __init__(self, context: Context) -> None:
        self.asked: list[Any] = []
        self.node = Node("planner", context=context)
        self.server = PatientActionServer(self.node, Plan, f"/{names.PLAN}", self.run)

    def run(self, goal: ServerGoalHandle) -> Any:
        self.asked.append(goal.request)
        result = Plan.Result(program_id="asked")
        result.status.code = 1
        result.report.duration = goal.request.cycle_time or 11.0
        result.report.energy = 9_000.0
        result.front = [
            ProgramPoint(cycle_time=10.0, energy=9_500.0, program_id="fast"),
            ProgramPoint(cycle_time=12.0, energy=8_800.0, program_id="least"),
            ProgramPoint(cycle_time=20.0, energy=11_000.0, program_id="slow"),
        ][: goal.request.front_points]
        total = Saving(common=12_000.0, planned=8_900.0, seconds=11.5)
        result.savings = ProgramSavings(
            available=True, movements=total, program_id="held", sentence="what is saved"
        )
        goal.succeed()
        return result


@pytest.fixture
def ros_discovery_range() -> str:
    """The command has a participant of its own, which has to find the planner."""
    return "SYSTEM_DEFAULT"


@pytest.fixture
def planner(
    ros_context: Context, ros_domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Planner]:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
    executor = SingleThreadedExecutor(context=ros_context)
    planner = Planner(ros_context)
    executor.add_node(planner.node)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    yield planner
    executor.shutdown()
    spinning.join()
    planner.server.destroy()  # else the next client takes it for the planner that comes
    planner.node.destroy_node()


def test_the_front_is_printed_and_drawn(
    planner: Planner, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "new" / "front.png"
    assert main(["ros", "front", "home", "park", "--points", "3", "--output", str(picture)]) == 0
    (asked,) = planner.asked
    assert asked.blend == -1.0  # as the cell says
    assert (list(asked.stations), asked.front_points, asked.savings) == (["home", "park"], 3, True)
    shown = capsys.readouterr().out
    rows = [line.split() for line in shown.splitlines()]
    assert ["12.00", "8.80", "least", "cheapest", "cycle", "time"] in rows
    assert ["11.50", "12.00", "common", "program"] in rows
    assert ["11.50", "8.90", "held", "planned", "in", "its", "time"] in rows
    assert "what is saved" in shown
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_chosen_cycle_time_is_planned_too(
    planner: Planner, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [
        "front",
        "--cycle-time",
        "13",
        "--points",
        "3",
        "--blend",
        "0.05",
        "--output",
        str(tmp_path / "front.png"),
    ]
    assert main(arguments) == 0
    assert [asked.cycle_time for asked in planner.asked] == [0.0, 13.0]
    assert [asked.blend for asked in planner.asked] == [0.05, 0.05]
    assert "chosen cycle time" in capsys.readouterr().out
