"""Law: what a plan saves a year is one figure, in the comparison and in the report of the plan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ir_cli.ros.plan_recording import RecordedRequest, write_plan
from ir_msgs_py.savings import BeforeAfter
from ir_planner import Planner, ProgramPlan
from ir_recorder import analyse, findings, read_recording
from ir_recorder.analysis.production import production_of
from ir_recorder.report import report_html
from ir_recorder.report.before_after import before_after_html, quarter_of, year_of
from ir_recorder.report.money_text import yearly_money
from ir_recorder.report.prices import Costs


@pytest.mark.long
def test_comparison_and_report_of_a_plan_show_one_saving(
    planner: Planner, planned: ProgramPlan, common: BeforeAfter, tmp_path: Path
) -> None:
    request = RecordedRequest(("p1", "home"), savings=True)
    file = write_plan(tmp_path / "plan.mcap", planned, request, planner)
    analysis = analyse(read_recording(file))
    cycle = production_of(analysis)
    assert cycle is not None

    assert cycle.savings is not None
    assert cycle.savings.common_demand == pytest.approx(quarter_of(common.today), rel=1e-9)

    rng = np.random.default_rng(0)
    for low, high in ((0.05, 0.2), (0.2, 0.5), (0.5, 1.0)):
        costs = Costs(
            price=rng.uniform(low, high),
            shift_hours=rng.uniform(4.0, 8.0),
            days_per_year=rng.uniform(50.0, 300.0),
        )
        year = year_of(common, common.planned, costs)
        found = costs.saving_of_year(cycle)
        assert found is not None
        assert found.value == pytest.approx(year.saved.value, rel=1e-9)
        assert (found.low, found.high) == pytest.approx((year.saved.low, year.saved.high), rel=1e-9)

        # what it saves and what it takes are of one program, in the time of the common one
        energy = costs.energy_of_year(cycle)
        assert energy.value == pytest.approx(year.energy.value, rel=1e-9)
        assert sum(share.energy for share in cycle.modes.values()) == pytest.approx(cycle.energy)

        pages = (
            before_after_html(common, planner.cell, costs),
            report_html(analysis, findings(analysis), costs=costs),
        )
        for joules in (found.value, energy.value):
            shown = yearly_money(costs.money(joules), costs.currency)
            assert all(shown in page for page in pages)
