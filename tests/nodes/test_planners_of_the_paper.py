"""The paper's planners over ROS: the bytes of the library, or a sentence that says how to install
OMPL.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from sensor_msgs.msg import JointState

from ir_description.cell import Task
from ir_msgs.msg import PlanOptions, Status
from ir_msgs.srv import PlanRegionalMovement
from ir_msgs_py.options import PlanOptions as Options
from ir_planner import Goal, Planner
from ir_planner.search import SEARCHES, repeatable
from ir_planner.search.with_ompl import host, needs_ompl

# checks: enough for this task
SEED = 11
WORK = 3000
CHEAP = ("sbl", "kpiece", "rrt_connect")
OTHERS = tuple(name for name, s in SEARCHES.items() if needs_ompl(s) and name not in CHEAP)


@pytest.fixture
def cell_name() -> str:
    return "open"


def library() -> tuple[Planner, Task]:
    planner = Planner("open", clock=itertools.repeat(0.0).__next__)
    return planner, planner.cell.task("p1->p2")


def over_ros(call: Callable[..., Any], task: Task, name: str) -> Any:
    names = [f"joint_a{k}" for k in range(1, 7)]
    start, goal = (JointState(name=names, position=list(q)) for q in (task.start, task.goal))
    options = PlanOptions(planner_id=name, seed=SEED, max_iterations=WORK)
    return call(
        PlanRegionalMovement,
        "plan_regional_movement",
        start=start,
        goal_state=goal,
        options=options,
    )


def check(call: Callable[..., Any], names: tuple[str, ...]) -> None:
    planner, task = library()
    for name in names:
        answer = over_ros(call, task, name)
        assert answer.status.code == Status.SUCCESS, f"{name}: {answer.status.message}"
        assert answer.report.certified
        assert answer.info.planner_id == name
        if repeatable(SEARCHES[name]):
            options = Options(planner_id=name, seed=SEED, max_iterations=WORK)
            plan = planner.plan_regional(
                start=task.start, goal=Goal(configuration=task.goal), options=options
            )
            assert plan.trajectory is not None
            assert answer.trajectory_id == plan.trajectory.trajectory_id


def test_planners_answer_over_ros_as_in_the_library(call: Callable[..., Any]) -> None:
    check(call, CHEAP)


@pytest.mark.long
def test_all_others_do_too(call: Callable[..., Any]) -> None:
    check(call, OTHERS)


def test_without_ompl_the_answer_says_how_to_install_it(
    call: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(host, "find_spec", lambda name: None)
    answer = over_ros(call, library()[1], "kpiece")
    assert answer.status.code == Status.INVALID_GOAL_CONSTRAINTS
    assert 'pip install "ir_planner[ompl]"' in answer.status.message
