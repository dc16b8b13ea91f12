"""Several robots by service: the plan of the library, kept by its ids; what makes no sense is
answered by a sentence, and the planner's own cell stays.
"""

from __future__ import annotations

import math
from typing import Any

import pytest

from ir_description import RobotCells
from ir_msgs.srv import PlanRobots
from ir_msgs_py.ros.plan_conversions import planned_movement_from_msg
from ir_msgs_py.status import StatusCode
from ir_planner.node.inputs import LastState
from ir_planner.node.requests import Requests
from ir_planner.planner import Planner
from ir_planner.robots import RobotsPlan, plan_robots

CYCLE_TIME = 12.0  # s
WORK = 300  # iterations: what is chosen doesn't matter here


@pytest.fixture(scope="module")
def requests() -> Requests:
    return Requests(
        planner=Planner("demo", clock=lambda: 0.0),
        last_state=LastState(),
        now=lambda: 0.0,
        draw_seed=lambda: 7,
        log=print,
    )


def asked(requests: Requests, cancelled: bool = False, **fields: Any) -> PlanRobots.Response:
    handler = requests.guarded(requests.plan_robots)
    request = PlanRobots.Request(**fields)
    request.options.max_iterations = WORK
    return handler(request, PlanRobots.Response(), lambda: cancelled)


def test_the_answer_is_the_library_s_plan_and_is_kept(
    requests: Requests, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans: list[RobotsPlan] = []
    calls: list[dict[str, Any]] = []

    def planned(cells: RobotCells, **choices: Any) -> RobotsPlan:
        assert cells.name == "two_robots"
        calls.append(choices)
        plans.append(plan_robots(cells, **choices))
        return plans[-1]

    monkeypatch.setattr("ir_planner.node.requests.plan_robots", planned)
    request = PlanRobots.Request(cell_file="two_robots", cycle_time=CYCLE_TIME)
    request.options.include_points = True
    request.options.max_iterations = WORK
    cell = requests.planner.cell
    handler = requests.guarded(requests.plan_robots)
    answer = handler(request, PlanRobots.Response())
    assert answer.status.code == StatusCode.SUCCESS, answer.status.message
    (plan,) = plans
    assert calls[0]["cycle_time"] == CYCLE_TIME
    assert calls[0]["peak_power"] == 0.0
    assert calls[0]["options"].max_iterations == WORK
    assert calls[0]["settings"] is requests.planner.settings
    assert [each.robot for each in answer.robots] == list(plan.robots)
    assert requests.planner.cell is cell
    for k, (own, program) in enumerate(zip(answer.robots, plan.programs, strict=True)):
        assert own.program_id == program.program_id
        kept = requests.planner.programs.get(own.program_id)
        assert [m.trajectory_id for m in kept.movements] == [
            m.trajectory_id for m in program.movements
        ]
        steps = [planned_movement_from_msg(each) for each in (*own.lead, *own.movements)]
        sent = plan.run(own.robot, 1)
        assert [(s.kind, s.wait_for, s.set_signals) for s in steps] == [
            (s.kind, s.wait_for, s.set_signals) for s in sent
        ]
        assert own.begin == plan.begins[k]
    assert [zone.signal for zone in answer.zones] == [zone.signal for zone in plan.zones]
    assert answer.zones[0].turn == plan.zones[0].turn
    assert answer.period == plan.period
    assert answer.energy == pytest.approx(sum(own.report.energy for own in answer.robots))
    assert answer.certified
    assert answer.proved == plan.proved


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({}, "exactly one of cell_yaml and cell_file"),
        ({"cell_file": "demo"}, "the cell 'demo' has one robot"),
        ({"cell_file": "nowhere"}, "cell 'nowhere' is unknown"),
        ({"cell_file": "/etc/cell.yaml"}, "lies outside of the folders"),
        ({"cell_yaml": "robots: ["}, "this is not YAML"),
        ({"cell_file": "two_robots", "cycle_time": math.nan}, "cycle_time is nan"),
        ({"cell_file": "two_robots", "cycle_time": 1.0}, "the shortest of all robots together"),
        ({"cell_file": "two_robots", "peak_power": -1.0}, "peak_power is -1 W"),
        pytest.param(
            {"cell_file": "two_robots", "peak_power": 1.0},
            "needs more than its share of the peak",
            marks=pytest.mark.long,
        ),
    ],
)
def test_what_makes_no_sense_is_refused(
    requests: Requests, fields: dict[str, Any], sentence: str
) -> None:
    answer = asked(requests, **fields)
    assert answer.status.code != StatusCode.SUCCESS
    assert sentence in answer.status.message
    assert not answer.robots


def test_a_cancelled_request_ends(requests: Requests) -> None:
    answer = asked(requests, cancelled=True, cell_file="two_robots")
    assert answer.status.code == StatusCode.PREEMPTED
