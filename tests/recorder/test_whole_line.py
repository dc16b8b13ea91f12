"""A saving of the robots in the whole line: one definition, held against sums of joules."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from ir_description import load_power_data
from ir_msgs_py.savings import Saving
from ir_recorder import Analysis, findings
from ir_recorder.analysis.production import Amount, production_of
from ir_recorder.report import report_html, whole_line
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_figures import fleet_of_line
from ir_recorder.report.fleet_members import member_of
from ir_recorder.report.prices import Costs
from ir_recorder.report.whole_line import line_section, of_recording, of_saving, of_whole_line


@pytest.mark.parametrize("seed", range(20))
def test_the_shares_are_those_of_a_line_that_is_metered(seed: int) -> None:
    """A line of drawn consumers, metered with and without the saving."""
    draw = np.random.default_rng(seed).uniform
    names = ("robots", "stand_by", "technology", "infrastructure")
    joules = dict(zip(names, draw(1.0, 1e6, 4), strict=True))
    factory = sum(joules.values())
    shares = {f"line_{name}": 100.0 * value / factory for name, value in joules.items()}
    share = draw(-0.5, 1.0)
    saved = share * joules["robots"]
    robots_of_a_cell = draw(1.0, 1e9)
    costs = replace(Costs(), **shares)
    low, high = (share + each for each in (-0.1, 0.2))
    found = of_whole_line(Amount(share, low, high).times(robots_of_a_cell), robots_of_a_cell, costs)
    assert found is not None
    assert found.factory.value == pytest.approx(100.0 * saved / factory)
    line = factory - joules["infrastructure"]
    assert found.line.value == pytest.approx(100.0 * saved / line)
    assert found.line.low == pytest.approx(100.0 * low * joules["robots"] / line)
    assert found.factory.high == pytest.approx(100.0 * high * joules["robots"] / factory)
    assert sum(found.after.values()) == pytest.approx(100.0 * (factory - saved) / factory)
    assert found.factory.value <= costs.line_robots + 1e-9


def test_nobody_s_shares_are_table_1() -> None:
    percent = {row.consumer: row.percent for row in load_power_data().table_1}
    costs = Costs()
    assert costs.line_robots == percent["robot_drives"]
    assert costs.line_infrastructure == percent["factory_environment"]
    assert sum(costs.line.values()) == pytest.approx(sum(percent.values()))
    found = of_saving(Saving(200.0, 100.0), costs)
    assert found is not None
    assert "robots take 25.5 % and the hall 50 %" in found.sentence
    assert "25.5 % of the line's and 12.8 % of the factory's" in found.sentence


def test_table_1_stands_in_four_groups_on_the_page() -> None:
    costs = Costs()
    assert costs.line == {
        "robots": 25.5,
        "stand_by": 4.5,
        "technology": 7.0 + 9.5 + 1.5 + 2.0,
        "infrastructure": 50.0,
    }
    page = line_section(of_saving(Saving(200.0, 100.0), costs), costs)
    rows = [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row) for row in page.split("<tr")[2:]]
    plain = [[re.sub(r"<.*?>", "", cell) for cell in row] for row in rows]
    assert plain == [
        ["robots", "25.5 %", "12.8 %"],
        ["line stand-by", "4.5 %", "4.5 %"],
        ["technology (welding, gluing, PLCs)", "20.0 %", "20.0 %"],
        ["infrastructure (the hall)", "50.0 %", "50.0 %"],
        ["the line, without its hall", "50.0 %", "37.2 %"],
        ["the factory", "100.0 %", "87.2 %"],
    ]


def test_what_may_be_no_saving_and_what_leaves_the_controller_out_has_no_share(
    analysis: Analysis, monkeypatch: pytest.MonkeyPatch
) -> None:
    costs = Costs()
    assert of_saving(Saving(200.0, 100.0, saved_low=-1.0, saved_high=201.0), costs) is None
    assert of_saving(Saving(200.0, 100.0, saved_low=1.0, saved_high=199.0), costs) is not None
    cycle = production_of(analysis)
    assert cycle is not None
    for drives_only in (False, True):
        said = replace(cycle, drives_only=drives_only)
        monkeypatch.setattr(whole_line, "production_of", lambda _, said=said: said)
        assert (of_recording(analysis, costs) is None) is drives_only


def test_report_and_fleet_say_the_same(analysis: Analysis) -> None:
    member = member_of(analysis, "robot")
    cycle = production_of(analysis)
    assert member is not None
    assert cycle is not None
    assert cycle.savings is not None
    costs = Costs()
    found = of_saving(cycle.savings.total, costs)
    assert found is not None
    fleet = fleet_of_line([member, replace(member, robot="another"), member], costs)
    assert fleet is not None
    assert fleet.line.value == pytest.approx(found.line.value)
    shown = f"{found.line.value:.1f} %"
    pages = (report_html(analysis, findings(analysis)), fleet_html([member]))
    assert all("If a whole line did the same" in page and shown in page for page in pages)


def test_robots_that_take_nothing_have_no_share() -> None:
    assert of_saving(Saving(), Costs()) is None
