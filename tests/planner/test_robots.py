"""The cells of the bundled robots: programs are planned and certified, pauses as the controllers
allow.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_planner import Planner
from ir_planner.program import lengths_of

# an arm without a spherical wrist has 64 configurations at every station, and a minute of work
CELLS = ("kr6_bench", "kr300_pallets", pytest.param("ur10e_bench", marks=pytest.mark.long))


def planner_in(cell: str) -> Planner:
    return Planner(cell, clock=itertools.repeat(0.0).__next__)


@pytest.mark.parametrize("name", CELLS)
def test_its_program_is_planned_and_certified(name: str) -> None:
    planner = planner_in(name)
    options = PlanOptions(planning_time=600.0)
    plan = planner.plan_program(options=options, start=planner.cell.posture("park"))
    assert plan.status.ok, plan.status.message
    assert all(
        movement.report.certified for movement in plan.movements if movement.trajectory is not None
    )


def test_without_a_table_a_pause_stays_on_motors() -> None:
    planner = planner_in("ur10e_bench")
    advice = planner.standby(3600.0, load="none")
    assert advice.modes == ("STAND_ON_MOTORS",)
    assert advice.saving == 0.0
    assert [mode.name for mode in advice.alternatives] == ["STAND_ON_MOTORS"]
    unknown = planner.standby(lengths_of(0.0, np.array([10.0, 1000.0, 100_000.0])), load="none")
    assert unknown.modes == ("STAND_ON_MOTORS",)


def test_with_a_table_it_rests_in_it() -> None:
    assert planner_in("kr300_pallets").standby(3600.0, load="none").chosen.name == "HIBERNATION"
