"""A plan that was never driven as a recording, with its request, cell and settings."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message

from ir_description import cell_to_yaml, robot_urdf
from ir_msgs.msg import RecordedCall
from ir_msgs.srv import PlanProgram
from ir_msgs_py import names
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.conversions import status_to_msg, trajectory_to_msg
from ir_msgs_py.ros.plan_conversions import plan_options_to_msg, program_savings_to_msg
from ir_msgs_py.ros.power_conversions import cell_state_to_msg
from ir_planner import Planner, ProgramPlan
from ir_planner.before_after import doors_as_assumed
from ir_planner.node.answers import fill_program
from ir_planner.node.topics import cell_state
from ir_recorder.format import contents
from ir_recorder.format.qos import QosOffer
from ir_recorder.recording import CellFiles, RecordingSession, RecordingWriter
from ir_values.files import ANYWHERE, FileRoots
from ir_values.settings import tree

_DOORS = "doors_at_the_start"
_STEP = 1_000_000  # ns between two messages, so that their order is seen


@dataclass(frozen=True)
class RecordedRequest:
    """What was asked: stations (empty: the cell's program), cycle time [s], options, and whether
    the program was held against the common one.
    """

    stations: tuple[str, ...] = ()
    cycle_time: float = 0.0
    options: PlanOptions = field(default_factory=PlanOptions)
    savings: bool = False


def write_plan(
    path: str | Path,
    plan: ProgramPlan,
    request: RecordedRequest,
    planner: Planner,
    roots: FileRoots | None = None,
) -> Path:
    """Write the plan of a program, with its request, the planner's cell and its settings, as a
    recording.

    RecorderError or WriteError where that can't be.
    """
    writer = RecordingWriter(path, roots=roots or ANYWHERE)
    now = time.time_ns()
    cell = planner.cell
    facts = {contents.PLAN: "never driven"}
    doors = doors_as_assumed(cell)
    if doors:
        facts[_DOORS] = doors
    if plan.savings.common_seconds > 0.0:
        facts[contents.COMMON_SECONDS] = f"{plan.savings.common_seconds!r} s"
    if plan.savings.common_demand > 0.0:
        facts[contents.COMMON_DEMAND] = f"{plan.savings.common_demand!r} W"
    session = RecordingSession(writer, facts, now)
    urdf = robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose)
    session.attach_cell(CellFiles(cell_to_yaml(cell), urdf), now)
    session.attach(contents.PARAMETERS.format(node=names.PLANNER), _parameters(planner), now)
    if planner.settings.power_parameters:
        text = Path(planner.settings.power_parameters).read_text(encoding="utf-8")
        session.attach(contents.POWER_PARAMETERS, text, now)
    for number, (topic, kind, latched, message) in enumerate(
        _messages(plan, request, planner, now)
    ):
        session.open_topic(f"/{topic}", kind, [QosOffer(transient_local=latched)])
        session.message(f"/{topic}", serialize_message(message), now + number * _STEP)
    return session.finish().path


def _messages(
    plan: ProgramPlan, request: RecordedRequest, planner: Planner, now: int
) -> list[tuple[str, str, bool, Any]]:
    """Topic, type, whether it is latched, and message, in the order in which the node publishes
    them.
    """
    state = cell_state_to_msg(cell_state(planner.cell, planner.cell_hash))
    state.header.stamp = _stamp(now)
    found: list[tuple[str, str, bool, Any]] = [(names.CELL, "ir_msgs/msg/CellState", True, state)]
    if plan.savings.available:
        savings = program_savings_to_msg(plan.savings)
        found.append((names.PROGRAM_SAVINGS, "ir_msgs/msg/ProgramSavings", True, savings))
    kind = "trajectory_msgs/msg/JointTrajectory"
    found += [
        (names.PLANNED_TRAJECTORY, kind, True, trajectory_to_msg(step.trajectory))
        for step in plan.movements
        if step.trajectory is not None
    ]
    call = _call(plan, request, now)
    return [*found, (f"{names.PLANNER}/{names.CALLS}", "ir_msgs/msg/RecordedCall", False, call)]


def _call(plan: ProgramPlan, request: RecordedRequest, now: int) -> RecordedCall:
    asked = PlanProgram.Request(
        stations=list(request.stations),
        cycle_time=request.cycle_time,
        options=plan_options_to_msg(request.options),
        savings=request.savings,
    )
    answer = PlanProgram.Response(status=status_to_msg(plan.status))
    fill_program(answer, plan, include_points=False)
    call = RecordedCall(node=f"/{names.PLANNER}", service=f"/{names.PLAN_PROGRAM}")
    call.type = "ir_msgs/srv/PlanProgram"
    call.header.stamp = _stamp(now)
    call.request = serialize_message(asked)
    call.response = serialize_message(answer)
    return call


def _parameters(planner: Planner) -> str:
    values = {
        name: list(each.default) if isinstance(each.default, tuple) else each.default
        for name, each in tree(planner.settings).items()
    }
    return str(yaml.safe_dump({f"/{names.PLANNER}": {"ros__parameters": values}}, sort_keys=True))


def _stamp(time_ns: int) -> Time:
    return Time(sec=time_ns // 1_000_000_000, nanosec=time_ns % 1_000_000_000)
