"""Laws of a program's energy over its cycle time, on programs drawn in several cells.

E(T + d) <= E(T) + the cheapest wait of d. The drives' energy never rises with T while the wait at the end
stays in its mode: where a wait gets long enough for a deeper one, hurrying into it is cheaper at the mains,
which costs the drives more.
"""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_planner import Planner, ProgramPlan

POINTS = 12
LAW = 1e-3  # of E: movements are compared at a ladder of values
RISE = 5e-3  # of the drives' energy: parts are exchanged for others, whose paths differ


@pytest.mark.parametrize("cell", ["demo", "open", "table_columns"])
def test_energy_over_cycle_time_keeps_its_laws(cell: str) -> None:
    planner = Planner(time.monotonic)
    planner.set_cell("", cell)
    park = np.array(planner.cell.park)
    rng = np.random.default_rng([1, *cell.encode()])
    names = [station.name for station in planner.cell.stations]
    stops = (*(str(name) for name in rng.choice(names, 2, replace=False)), "park")
    options = PlanOptions(planning_time=100.0)
    plan = planner.plan_program(stops, 0.0, options, park, front_points=POINTS)
    assert plan.status.ok, plan.status.message
    front = plan.front
    assert len(front) == POINTS
    assert front[-1].report.duration == pytest.approx(2.0 * plan.report.duration, rel=1e-2)
    for point in front:
        assert point.report.certified
        assert all(step.report.certified for step in point.movements)
    for before, after in itertools.combinations(front, 2):
        d = after.report.duration - before.report.duration
        assert d > 0.0
        wait = planner.standby(d, park, "").energy
        assert after.report.energy <= (1.0 + LAW) * (before.report.energy + wait)
        if wait_mode(before) == wait_mode(after):
            assert drive_energy(after) <= (1.0 + RISE) * drive_energy(before)


def wait_mode(plan: ProgramPlan) -> str:
    """Mode of the wait at the end; "": on motors, or none."""
    last = plan.movements[-1]
    return last.power_mode.replace("STAND_ON_MOTORS", "") if last.is_pause else ""


def drive_energy(plan: ProgramPlan) -> float:
    """Joules of the drives while the program moves."""
    return sum(step.report.energy - step.report.base_energy for step in plan.movements if not step.is_pause)
