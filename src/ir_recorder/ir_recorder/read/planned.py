"""The steps of the last program that was planned, from the planner's answer that a recording holds.

The answers of ir_msgs/action/Plan and ir_msgs/srv/PlanProgram have the same fields.
"""

from __future__ import annotations

import math

from ir_msgs_py.errors import MsgsError
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_recorder.errors import ReadError
from ir_recorder.read.cdr import Columns
from ir_recorder.read.front import ACTION, answers, result_definition
from ir_recorder.read.raw import RawChannel

SERVICE = "ir_msgs/srv/PlanProgram"
MOST_STEPS = 1_000


def planned_steps(channel: RawChannel | None) -> tuple[PlannedMovement, ...]:
    """Steps of the last answer on a planner's calls that has some, without points; empty where none
    has.
    """
    definition = result_definition()
    if channel is None or channel.message_encoding != "cdr" or not definition:
        return ()
    for answer in answers(channel, (ACTION, SERVICE)):
        if steps := _steps_of(answer, definition):
            return steps
    return ()


def _steps_of(answer: bytes, definition: str) -> tuple[PlannedMovement, ...]:
    try:
        columns = Columns([answer], f"{ACTION.replace('/action/', '/msg/')}_Result", definition)
    except ReadError:
        return ()
    steps: list[PlannedMovement] = []
    for k in range(MOST_STEPS):
        seconds = float(columns.numbers(f"movements[{k}].duration")[0])
        if not math.isfinite(seconds):
            break
        try:
            steps.append(_step(columns, f"movements[{k}]", seconds))
        except MsgsError:
            return ()
    return tuple(steps)


def _step(columns: Columns, place: str, seconds: float) -> PlannedMovement:
    def text(name: str) -> str:
        return columns.texts(f"{place}.{name}")[0]

    def number(name: str) -> float:
        return float(columns.numbers(f"{place}.report.{name}")[0])

    return PlannedMovement(
        kind=text("kind"),
        from_station=text("from_station"),
        to_station=text("to_station"),
        power_mode=text("power_mode"),
        load=text("load"),
        duration=seconds,
        report=TrajectoryReport(
            duration=seconds,
            energy=number("energy"),
            energy_low=number("energy_low"),
            energy_high=number("energy_high"),
            peak_power=number("peak_power"),
            min_clearance=number("min_clearance"),
        ),
    )
