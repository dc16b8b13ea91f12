"""A tended cell written for the public benchmark: read back and solved by another model, it costs
what the planner proves that no cycle can be below.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from ir_description import load_cell
from ir_planner import Planner
from ir_studies.cells import read_instances, solve_cell, tended_instance, written
from ir_studies.errors import SettingsError

AGREED = 1e-4  # of the energy: hops of a millisecond


@pytest.mark.long
def test_another_model_finds_the_same_energy(tmp_path: Path) -> None:
    cell = load_cell("flexible")
    assert cell.route is not None
    machines = tuple(
        machine if machine.name in ("washer", "gauge") else replace(machine, process=0.0)
        for machine in cell.equipment
    )
    visits = ("infeed_pick", "washer_basket", "gauge_seat", "outfeed_place")
    cell = replace(cell, equipment=machines, route=replace(cell.route, visits=visits))
    plan = Planner(cell, clock=lambda: 0.0).plan_steady_cycle(parts_per_hour=50.0)
    assert plan.cycle is not None
    file = tmp_path / "cell.xml"
    file.write_text(written([tended_instance(plan)]))
    (instance,) = read_instances(file)
    assert instance.cycle == pytest.approx(plan.cycle.period, abs=1e-6)
    answer = solve_cell(instance, 120.0)
    assert answer.gap == 0.0
    least = plan.cycle.joules * (1.0 - plan.gap / 100.0)
    assert answer.energy == pytest.approx(least, rel=AGREED)
    with pytest.raises(SettingsError, match="makes 2 parts: only cycles of one are written"):
        tended_instance(replace(plan, cycle=replace(plan.cycle, units=2)))
