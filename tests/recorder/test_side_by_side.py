"""Recordings side by side: figures against the first, steps matched by label, files out."""

from __future__ import annotations

import base64
import csv
import io
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs_py.savings import ProgramPoint
from ir_recorder import Analysis, analyse, findings
from ir_recorder.analysis.production import production_of
from ir_recorder.report.charts import COLOURS, MARKS, Point, front_chart, front_section, pareto
from ir_recorder.report.headline import source
from ir_recorder.report.money_text import yearly_money
from ir_recorder.report.number_text import joules, kilowatt_hours, seconds
from ir_recorder.report.page import asset
from ir_recorder.report.prices import Costs
from ir_recorder.report.side_by_side import _WITH_PAUSES, comparison_html
from ir_recorder.report.step_table import step_columns, write_table
from ir_recorder.report_main import main


@pytest.fixture
def other(analysis: Analysis) -> Analysis:
    """The same run on a meter that reads a tenth more."""
    return _dearer(analysis)


def _dearer(analysis: Analysis) -> Analysis:
    power = analysis.recording.power
    assert power is not None
    more = replace(
        power, power=power.power * 1.1, energy=power.energy * 1.1, plant="typical, seed 1"
    )
    return analyse(replace(analysis.recording, power=more, path=Path("other.mcap")))


def page_of(*analyses: Analysis) -> str:
    return comparison_html([(each, findings(each)) for each in analyses])


def test_a_tenth_more_is_ten_percent(analysis: Analysis, other: Analysis) -> None:
    page = page_of(analysis, other)
    assert page.count("+10.00 %") >= 1 + len(analysis.steps)
    assert "demo is what the others are held against" in page
    assert "different plants" in page
    assert "different plants" not in page_of(analysis, analysis)


def plain(page: str) -> str:
    """The page without the elements of its amounts of money."""
    return re.sub(r"</?data[^>]*>", "", page)


def test_the_answer_names_the_program_that_costs_least(analysis: Analysis, other: Analysis) -> None:
    years = [Costs().energy_of_year(production_of(each)) for each in (analysis, other)]
    less = yearly_money(Costs().money(years[1].value - years[0].value), "EUR")
    page = plain(page_of(other, analysis))
    assert f"<b>demo: {less} less a year</b>" in page
    assert "<li>Drive demo.</li>" in page
    assert "<li>Hibernation" in page  # what nights save is not forgotten
    assert "<b>demo costs least</b>" in page_of(analysis, other)
    assert "<li>Keep demo.</li>" in page_of(analysis, other)
    alike = page_of(analysis, analyse(replace(analysis.recording, path=Path("again.mcap"))))
    assert "<b>None is shown to cost less than demo</b>" in alike


@pytest.mark.parametrize(("within", "said"), [(None, False), ((0.1, 10.0), True)])
def test_a_run_costs_what_its_plan_predicts_only_where_that_is_shown(
    analysis: Analysis, within: tuple[float, float] | None, said: bool
) -> None:
    """Without an interval of the plan it stood beside any deviation."""
    bare = replace(analysis.recording, power=None, joints=None, controller=None, hardware="")
    steps = tuple(result.step.movement for result in analysis.steps)
    energy = sum(step.report.energy for step in steps)
    ends = tuple(share * energy for share in within or (1.0, 1.0))
    recording = replace(bare, events=(), planned=steps, path=Path("plan.mcap"))
    plan = analyse(replace(recording, planned_interval=ends))
    for pair in ((analysis, plan), (plan, analysis)):
        page = page_of(*pair)
        assert ("The run costs what its plan predicts" in page) == said
        assert ("both cost alike" in page) == said
        assert ("The run against the plan: " in page) != said
        assert " costs least" not in page


def test_power_on_the_common_grid_keeps_the_peaks_of_the_meter(
    analysis: Analysis, other: Analysis, data_of: Any
) -> None:
    (curves,) = data_of(page_of(analysis, other))["axes"]
    low, high = (
        np.frombuffer(base64.b64decode(curves[name]), "<i2").reshape(-1, 2) * curves["step"]
        for name in ("low", "high")
    )
    assert (low <= high).all()
    for k, each in enumerate((analysis, other)):
        power = each.recording.power
        assert power is not None
        span = (power.time >= each.steps[0].step.start) & (power.time <= each.steps[-1].step.end)
        assert high[:, k].max() == pytest.approx(power.power[span].max(), rel=1e-4)
        assert low[:-1, k].min() == pytest.approx(power.power[span].min(), abs=1.0)


def test_steps_that_one_recording_lacks_are_a_dash(analysis: Analysis) -> None:
    short = analyse(replace(analysis.recording, events=analysis.recording.events[:4]))
    steps = page_of(analysis, short).split('id="steps"')[1]
    assert re.search(r'<td class="n no"[^>]*>–</td>', steps)


def test_names_in_recordings_stay_text(analysis: Analysis) -> None:
    evil = replace(analysis.recording, path=Path("<img src=x>.mcap"), problems=("<b>x</b>",))
    page = page_of(analyse(evil), analysis)
    assert "<img" not in page
    assert "<b>x" not in page


def test_columns_are_the_figures_of_the_steps(analysis: Analysis, tmp_path: Path) -> None:
    columns = step_columns([analysis, analysis])
    assert columns["energy_j"] == [r.energy for r in analysis.steps] * 2
    path = write_table([analysis], tmp_path / "steps.csv")
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    assert [float(row["seconds_s"]) for row in rows] == [r.seconds for r in analysis.steps]
    assert {row["origin"] for row in rows} == {"simulated"}


def test_a_spreadsheet_takes_no_text_for_a_formula(analysis: Analysis, tmp_path: Path) -> None:
    evil = replace(analysis.recording, path=Path("=1+1.mcap"))
    text = write_table([analyse(evil)], tmp_path / "steps.csv").read_text()
    assert "\n=1" not in text
    assert "'=1+1.mcap" in text


def test_a_table_of_another_kind_is_a_sentence(
    demo_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = demo_file.parent
    out = ["-o", str(folder / "table_page.html"), "--root", str(folder)]
    assert main([str(demo_file), *out, "--table", str(folder / "steps.ods")]) == 1
    assert "ends in .csv, .xlsx or .parquet" in capsys.readouterr().err


def test_a_folder_is_compared_and_what_is_no_recording_left_out(
    demo_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["-o", str(tmp_path / "out.html"), "--root", str(tmp_path)]
    for name in ("a", "b"):
        (tmp_path / f"{name}.mcap").write_bytes(demo_file.read_bytes())
    (tmp_path / "c.mcap").write_text("not a recording")
    assert main([str(tmp_path), *out]) == 0
    assert "c.mcap: left out" in capsys.readouterr().err
    assert "<h1>2 recordings compared</h1>" in (tmp_path / "out.html").read_text()
    (tmp_path / "empty").mkdir()
    assert main([str(tmp_path / "empty"), *out]) == 1
    assert "no recording could be read" in capsys.readouterr().err
    assert main([str(tmp_path / "c.mcap"), *out]) == 1


POINTS = st.lists(
    st.builds(Point, st.just("p"), st.floats(1.0, 1e4), st.floats(1.0, 1e7), st.just("measured")),
    min_size=2,
    max_size=9,
)


@given(POINTS)
def test_no_point_beats_one_of_the_front_and_each_other_one_is_beaten(points: list[Point]) -> None:
    best = pareto(points)
    for point in points:
        beaten = any(
            b.seconds <= point.seconds
            and b.energy <= point.energy
            and (b.seconds, b.energy) != (point.seconds, point.energy)
            for b in points
        )
        assert beaten != any((b.seconds, b.energy) == (point.seconds, point.energy) for b in best)
    drawn = front_chart(points)
    assert "nan" not in drawn
    places = re.findall(r"translate\(([-\d.]+) ([-\d.]+)\)", drawn)
    assert len(places) == len(points)
    assert all(0.0 <= float(x) <= 720.0 and 0.0 <= float(y) <= 300.0 for x, y in places)


def test_names_of_points_that_nearly_coincide_stand_below_each_other() -> None:
    points = [Point(f"planner {k}", 2.0, 2051.0 + 1e-3 * k, "measured") for k in range(11)]
    drawn = front_chart(points)
    names = sorted(float(y) for y in re.findall(r'y="([-\d.]+)" class="name"', drawn))
    assert len(names) == 11
    assert all(b - a >= 13.9 for a, b in pairwise(names))
    lowest = max(float(y) for y in re.findall(r'd="M108 ([-\d.]+)H', drawn))
    assert (
        names[-1] < max(lowest, 256.0) + 0.1
    )  # not below the drawing, nor in the numbers of its axis
    ticks = re.findall(r'text-anchor="end">([^<]+)<', drawn)
    assert len(set(ticks)) == len(ticks) > 2  # no two read alike


def test_fifty_series_look_different_and_the_charts_draw_the_same_marks() -> None:
    assert len({(k % COLOURS, MARKS[k % len(MARKS)]) for k in range(50)}) == 50
    script = asset("axes.js")
    assert f"COLOURS = {COLOURS}," in script
    drawn = script.partition("const MARKS = [")[2].partition("]")[0]
    assert re.findall(r'"([^"]+)"', drawn) == list(MARKS)
    assert all(f"--s{k}:" in asset("page.css") for k in range(1, COLOURS + 1))


def test_plans_that_were_not_driven_are_compared_by_what_was_predicted(analysis: Analysis) -> None:
    bare = replace(
        analysis.recording, power=None, joints=None, controller=None, events=(), hardware=""
    )
    plan = analyse(replace(bare, path=Path("plan.mcap")))
    page = page_of(plan, plan)
    assert page.count("predicted, not driven") == 3
    assert "1.06 Wh" in page
    cycle = production_of(plan)
    assert cycle is not None
    assert (cycle.energy, cycle.seconds) == (3800.0, 5.7)
    assert "this run" not in front_section(plan)
    assert "Predicted" in source(plan)


def test_a_run_with_short_pauses_is_no_share_of_one_at_full_length(analysis: Analysis) -> None:
    """Once "+2685.83 %", and a point at the shortened time."""
    facts = (("unshortened_pauses", "600 s, 1800 s"),)
    short = analyse(
        replace(analysis.recording, facts=facts, path=analysis.recording.path.with_name("s.mcap"))
    )
    cycle = production_of(short)
    assert short.program is not None
    assert short.program.unshortened is not None
    page = page_of(analysis, short)
    rows = {name: re.search(rf"<tr><td[^>]*>{name}</td>.*?</tr>", page) for name in _WITH_PAUSES}
    for name, row in rows.items():
        assert row is not None, name
        assert "pauses shortened" in row[0]
        assert "%" not in row[0]
    if cycle is not None:
        assert f"s {seconds(cycle.seconds)}, {kilowatt_hours(cycle.energy)}" in page
    assert "+10.00 %" in page_of(short, _dearer(short))


def test_the_run_stands_beside_the_common_program(analysis: Analysis) -> None:
    front = [ProgramPoint(4.0, 9000.0, "a"), ProgramPoint(5.0, 5000.0, "b")]
    assert front_section(analysis, front).count("program of the front") == 2
    (event,) = analysis.recording.savings[-1:]
    moved = replace(event.savings.movements, seconds=event.savings.movements.seconds + 10.0)
    longer = replace(event, savings=replace(event.savings, movements=moved))
    recording = replace(analysis.recording, savings=(longer,))
    section = front_section(replace(analysis, recording=recording))
    for words in ("this run", "common program", "planned in its time"):
        assert words in section
    assert front_section(replace(analysis, recording=replace(analysis.recording, savings=()))) == ""


@given(
    st.floats(1.0, 1e5),
    st.floats(1e-3, 1e4),
    st.floats(10.0, 1e7),
    st.floats(1e-3, 1e6),
    st.sampled_from((joules, kilowatt_hours)),
)
def test_no_two_ticks_of_an_axis_read_alike(
    seconds: float, longer: float, energy: float, more: float, show: Callable[[float], str]
) -> None:
    """Once 33.6, 33.6, 33.6, 33.7, 33.7 min."""
    points = [Point("a", seconds, energy + more, "x"), Point("b", seconds + longer, energy, "x")]
    drawn = front_chart(points, show=show)
    for anchor in ("middle", "end"):
        ticks = re.findall(
            rf'text-anchor="{anchor}">(-?[\d .]+ (?:s|min|J|kJ|Wh|kWh))</text>', drawn
        )
        assert len(ticks) >= 2
        assert len(set(ticks)) == len(ticks)


def test_recordings_of_different_cells_have_no_shares_of_each_other(
    analysis: Analysis, other: Analysis
) -> None:
    assert other.cell is not None
    moved = replace(other, cell=replace(other.cell, name="another_cell"))
    page = comparison_html([(analysis, ()), (moved, ())])
    assert "(another_cell)" in page
    assert "+10.00 %" not in page
    assert "are of different cells" in page
