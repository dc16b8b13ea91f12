"""Requests of a recording planned once more: start states and drawn seeds are those of the
answers.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.ros.conversions import configuration_from_msg
from ir_msgs_py.status import StatusCode
from ir_planner import Planner
from ir_planner.node.inputs import MEASURED, LastState
from ir_planner.node.requests import Requests

from .recorded import Call, RecordedPlanner

HANDLERS = {
    "ir_msgs/srv/PlanServiceMovement": "plan_service",
    "ir_msgs/srv/PlanRegionalMovement": "plan_regional",
    "ir_msgs/srv/PlanTrajectory": "plan_trajectory",
    "ir_msgs/srv/OptimizeTrajectory": "optimize_trajectory",
    "ir_msgs/srv/PlanProgram": "plan_program",
    "ir_msgs/action/Plan": "plan_program",
}
"""The planner's handler of each type whose answers have ids."""
IDS = ("trajectory_id", "program_id")
_FRONT = "pareto front"  # the stage whose note has the ids of a front
_FREE = 1e-9  # s: the age of a state that is as it was


class Verdict(StrEnum):
    """What came of a request."""

    EQUAL = "equal"
    DIFFERENT = "different"
    NOT_COMPARED = "not compared"


@dataclass(frozen=True)
class Replanned:
    """One request: its service, how many ids its answer has, what came of it, and why."""

    service: str
    ids: int
    verdict: Verdict
    sentence: str = ""


def replan(recorded: RecordedPlanner) -> Iterator[Replanned]:
    """Every request that plans, in its order, with what the planner knew by then.

    Time stands still: an answer that its ceiling did not cut is not cut here either, however slow
    this is.
    """
    planner = recorded.planner(lambda: 0.0)
    changes = recorded.changes()
    states = recorded.states()
    for call in recorded.calls():
        while changes and changes[0].time <= call.time:
            changes.pop(0).make(planner)
        if call.type in HANDLERS:
            yield _again(planner, call, states)


def _again(planner: Planner, call: Call, states: list[tuple[int, bytes]]) -> Replanned:
    if call.response is None:
        return _not_compared(call, "its answer was too long to be recorded")
    if call.response.status.code == StatusCode.PREEMPTED:
        return _not_compared(call, "it was cancelled")
    if getattr(call.response.info, "truncated", False):
        return _not_compared(call, "its answer was cut by its planning time")
    problems: list[str] = []
    seed = int(call.response.info.seed)
    state = LastState(q=_start(planner, call, states))
    requests = Requests(
        planner,
        state,
        lambda: _FREE,
        lambda: None,
        lambda planned: None,
        lambda: seed,
        problems.append,
    )
    answer = type(call.response)()
    requests.guarded(getattr(requests, HANDLERS[call.type]))(call.request, answer)
    before = ids_of(call.response)
    now = ids_of(answer)
    if before == now:
        return Replanned(call.service, len(before) - 1, Verdict.EQUAL)
    other = [key for key in before | now if before.get(key) != now.get(key)]
    key = other[0]
    said = answer.status.message
    sentence = f"{key} was {before.get(key, 'none')}, is {now.get(key, 'none')}"
    sentence += f"; {len(other)} of {len(before | now)} differ" if len(other) > 1 else ""
    return Replanned(
        call.service, len(before) - 1, Verdict.DIFFERENT, f"{sentence}; {said}".strip("; ")
    )


def ids_of(message: Any) -> dict[str, str]:
    """The status and all ids of an answer by their place: "movements[2].trajectory_id"."""
    found = {"status": str(int(message.status.code))}
    found |= {place: value for place, name, value in _texts(message, "") if name in IDS and value}
    for stage in message.info.stages:
        if stage.name == _FRONT:
            found[_FRONT] = stage.note
    return found


def _texts(message: Any, place: str) -> Iterator[tuple[str, str, str]]:
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        here = f"{place}.{name}".lstrip(".")
        if isinstance(value, str):
            yield here, name, value
        elif hasattr(value, "get_fields_and_field_types"):
            yield from _texts(value, here)
        elif isinstance(value, list) and value and hasattr(value[0], "get_fields_and_field_types"):
            for k, each in enumerate(value):
                yield from _texts(each, f"{here}[{k}]")


def _start(planner: Planner, call: Call, states: list[tuple[int, bytes]]) -> Any:
    """The robot's state as the planner knew it: where the answer names its start, that one, to the
    bit.
    """
    start = np.array(call.response.info.start.position)
    if len(start) and not call.type.endswith("PlanServiceMovement"):  # its start is a candidate's
        return start
    before = bisect_right(states, call.time, key=lambda state: state[0])
    if not before:
        return None
    joints = planner.cell.robot.joint_names
    try:
        q = configuration_from_msg(deserialize_message(states[before - 1][1], JointState), joints)
    except InvalidValueError:
        return None
    return np.round(q, MEASURED) + 0.0


def _not_compared(call: Call, why: str) -> Replanned:
    return Replanned(call.service, 0, Verdict.NOT_COMPARED, why)
