"""What a run of an arena asks of a planner, request by request."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner import Goal, MovementPlan, Planner, RequestError
from ir_studies.arena.one_run import one_run, planned_in
from ir_studies.arena.settings import ArenaEntry, ArenaSettings

FURTHER = 20_000
ENTRY = ArenaEntry("portfolio", "deep_box", "pal->bin", 3, "", "synchronous")


@pytest.fixture(scope="module")
def planner() -> Planner:
    """With the cell of the run; its clock stands, so that none of its answers is cut."""
    return Planner(ENTRY.cell, clock=lambda: 0.0)


def asked(
    planner: Planner, monkeypatch: pytest.MonkeyPatch, **settings: Any
) -> tuple[list[PlanOptions], Any]:
    """The options of the run's requests, and its row."""
    options_seen: list[PlanOptions] = []
    plan = planner.plan_regional

    def noted(*, start: Any, goal: Goal, options: PlanOptions) -> MovementPlan:
        options_seen.append(options)
        return plan(start=start, goal=goal, options=options)

    with monkeypatch.context() as patch:
        patch.setattr(planner, "plan_regional", noted)
        row = one_run(
            ENTRY, ArenaSettings((ENTRY.cell,), seconds=3600.0, **settings), planner, lambda: 0.0
        )
    return options_seen, row


def test_requests_after_the_first_may_use_more_work(
    planner: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    options, row = asked(planner, monkeypatch, requests=3, further_iterations=FURTHER)
    assert [one.max_iterations for one in options] == [0, FURTHER, FURTHER]
    assert len({one.seed for one in options}) == 3
    costs = [cost for _, cost in row["progress"]]
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < costs[0]  # which other seeds alone don't reach
    assert row["cost_j"] == costs[-1]


def test_all_requests_may_be_given_the_same_work(
    planner: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    options, row = asked(
        planner, monkeypatch, requests=2, max_iterations=9_000, further_iterations=0
    )
    assert [one.max_iterations for one in options] == [9_000, 9_000]
    assert row["solved"]


def test_what_comes_after_the_seconds_does_not_count(planner: Planner) -> None:
    """Each look at the clock takes a third of the seconds: the second request's answer is late."""
    instants = iter(range(1000))
    settings = ArenaSettings((ENTRY.cell,), seconds=3.5, requests=0, further_iterations=0)
    row = one_run(ENTRY, settings, planner, lambda: float(next(instants)))
    assert row["requests"] == 2
    assert [at for at, _ in row["progress"]] == [2.0]
    assert row["final_s"] == 2.0

    late = one_run(ENTRY, replace(settings, seconds=1.5), planner, lambda: float(next(instants)))
    assert not late["solved"]
    assert "after 2 s, over seconds 1.5" in late["message"]


def test_a_request_has_time_for_its_last_step_whatever_is_left() -> None:
    assert planned_in(10.0) == pytest.approx(10.0 - 0.05)
    assert planned_in(0.2) == pytest.approx(0.2 - 0.05)
    assert planned_in(0.04) == pytest.approx(0.02)
    assert planned_in(-1.0) == 0.001


def test_a_request_that_is_refused_takes_no_answer_of_the_run_away(
    planner: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = planner.plan_regional
    asked: list[int] = []

    def refused(*, start: Any, goal: Goal, options: PlanOptions) -> MovementPlan:
        asked.append(options.seed)
        if len(asked) > 1:
            raise RequestError(StatusCode.FAILURE, "OMPL's process does not start")
        return plan(start=start, goal=goal, options=options)

    monkeypatch.setattr(planner, "plan_regional", refused)
    settings = ArenaSettings((ENTRY.cell,), seconds=3600.0, further_iterations=0)
    row = one_run(ENTRY, settings, planner, lambda: 0.0)
    assert (row["solved"], row["message"], len(row["progress"])) == (True, "", 1)
    row = one_run(ENTRY, settings, planner, lambda: 0.0)
    assert (row["solved"], row["message"]) == (False, "OMPL's process does not start")
    assert len(asked) == 3
