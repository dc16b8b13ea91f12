"""planning_time cuts a program, its savings and its front at once; cancel is asked for all the
time.
"""

from __future__ import annotations

import contextlib
import itertools

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_planner import CancelledError, Planner, ProgramPlan

STOPS = ("infeed_pick", "home")
NEVER = 1e6  # s


class Ticking:
    """A clock that goes by a second whenever it is asked."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 1.0
        return self.now


def planned(seconds: float, *, savings: bool, front_points: int) -> tuple[ProgramPlan, float]:
    """The program with so much time in all, and how often the clock was asked."""
    clock = Ticking()
    planner = Planner("demo", clock=clock)
    start = np.array(planner.cell.machine_home)
    options = PlanOptions(planning_time=seconds / len(STOPS))
    plan = planner.plan_program(
        stations=STOPS, options=options, start=start, savings=savings, front_points=front_points
    )
    return plan, clock.now


def test_a_program_without_time_is_made_of_straight_segments() -> None:
    plan, _ = planned(2.0, savings=True, front_points=4)
    assert plan.status.ok, plan.status.message
    assert plan.info.truncated
    assert plan.front == ()
    assert plan.savings.sentence.startswith("no savings: planning_time")
    assert plan.info.iterations < 20_000


@pytest.mark.long
def test_time_that_ends_during_savings_or_front_cuts_them() -> None:
    whole, asked = planned(NEVER, savings=True, front_points=4)
    assert not whole.info.truncated
    assert whole.savings.available
    assert len(whole.front) == 4
    cut, until = planned(0.8 * asked, savings=True, front_points=4)
    assert cut.status.ok
    assert cut.info.truncated
    assert cut.program_id == whole.program_id
    assert until < asked


def test_a_program_is_cancelled_at_any_time() -> None:
    planner = Planner("demo", clock=lambda: 0.0)
    start = np.array(planner.cell.machine_home)

    def plan(until: float) -> int:
        """How often cancel was asked for, which is true from the `until`-th time on."""
        times = itertools.count(1)
        heard = 0

        def cancelled() -> bool:
            nonlocal heard
            heard = next(times)
            return heard >= until

        with contextlib.suppress(CancelledError):
            planner.plan_program(stations=STOPS, start=start, cancelled=cancelled, savings=True)
        return heard

    asked = plan(np.inf)
    for share in (0.3, 0.7, 0.95):
        until = int(share * asked)
        assert plan(until) <= until + 8  # every thread asks once more
