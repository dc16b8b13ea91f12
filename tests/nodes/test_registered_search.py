"""A search that is registered is planned with over ROS, refused by name when misspelt, and
documented.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from sensor_msgs.msg import JointState

from ir_msgs.msg import PlanOptions, Status
from ir_msgs.srv import PlanRegionalMovement
from ir_planner.checks import FreeSpace
from ir_planner.search import SEARCHES, Ends, Found
from ir_planner.settings import PlannerSettings
from ir_values.settings import setting, settings_table

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class OverTheTop:
    """The arm is lifted at both ends, then the first joint turns."""

    lift: float = setting(
        0.3, "How far joint 2 lifts the arm.", unit="rad", minimum=0.0, maximum=1.0
    )

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        up = np.array([0.0, -self.lift, 0.0, 0.0, 0.0, 0.0])
        path = np.stack([ends.start, ends.start + up, ends.goals[0] + up, ends.goals[0]])
        return Found([path] if space.paths_free([path])[0] else [], "the lifted path is not free")


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SEARCHES, "over_the_top", OverTheTop())


def ask(call: Callable[..., Any], planner_id: str) -> Any:
    start = JointState(name=[f"joint_a{k}" for k in range(1, 7)], position=list(HOME))
    options = PlanOptions(planner_id=planner_id)
    goal = "A1 30 A2 -100 A3 100 A4 0 A5 20 A6 0"
    return call(
        PlanRegionalMovement, "plan_regional_movement", start=start, goal=goal, options=options
    )


def test_it_is_planned_with(call: Callable[..., Any]) -> None:
    answer = ask(call, "over_the_top")
    assert answer.status.code == Status.SUCCESS, answer.status.message
    assert answer.report.certified
    assert answer.info.planner_id == "over_the_top"


def test_misspelt_it_is_refused_with_the_known_names(call: Callable[..., Any]) -> None:
    answer = ask(call, "over_the_topp")
    assert answer.status.code == Status.INVALID_GOAL_CONSTRAINTS
    assert "over_the_topp" in answer.status.message
    for known in SEARCHES:
        assert known in answer.status.message


def test_its_settings_are_parameters(call: Callable[..., Any]) -> None:
    answer = call(GetParameters, "get_parameters", names=["over_the_top.lift"])
    assert answer.values[0].type == ParameterType.PARAMETER_DOUBLE
    assert answer.values[0].double_value == 0.3


def test_the_table_of_the_documentation_lists_it() -> None:
    assert "| `over_the_top.lift` | 0.3 | rad | 0 .. 1 rad |" in settings_table(PlannerSettings())
