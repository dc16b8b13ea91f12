"""Today's programs of several kinds, compared once."""

from __future__ import annotations

from pathlib import Path

import pytest

from ir_krl import follow, parse
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.savings import BeforeAfter
from ir_planner import Planner, ProgramPlan
from ir_planner.before_after import before_after, before_after_common, today_of_krl
from ir_planner.krl import evaluate_krl, tool_in_flange

STATIONS = ("p1", "home")
WORK = PlanOptions(max_iterations=1000)  # two figures of one program need not be the least
OLD = (Path(__file__).parent / "old.src").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)  # a clock that cuts no plan of a busy machine


@pytest.fixture(scope="session")
def compared(planner: Planner) -> BeforeAfter:
    """An old program with detours and pauses, and a line that needs more time than it takes."""
    cell = planner.cell
    program = follow([parse(OLD, "old.src")], cell.machine_home, tool_in_flange(cell.tcp))
    return before_after(planner, today_of_krl(evaluate_krl(planner, program)), 60.0, WORK)


@pytest.fixture(scope="session")
def planned(planner: Planner) -> ProgramPlan:
    """A program of two movements, with what it saves."""
    start = planner.cell.machine_home
    return planner.plan_program(stations=STATIONS, start=start, options=WORK, savings=True)


@pytest.fixture(scope="session")
def common(planner: Planner) -> BeforeAfter:
    """The same program against PTP at 100 %."""
    return before_after_common(planner, STATIONS, planner.cell.machine_home, options=WORK)
