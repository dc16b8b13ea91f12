"""Law: figures of one name are rounded from one value, wherever they stand: every tile and table
of report, comparison, fleet and several robots, their CSV and workbooks, and the terminal.

The same of today's program beside the planner's stands in tests/before_after/test_page.py, of a
plan and its report in test_same_saving.py there, of the whole line in test_whole_line.py; README's
figures are compared with what their command writes in tests/packaging.
"""

from __future__ import annotations

import csv
import importlib.util
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from ir_cli.ros.demo import DemoOutcome
from ir_msgs.msg import PlannedMovement
from ir_msgs_py.modes import Mode
from ir_recorder import Analysis, Finding, analyse, findings, read_recording
from ir_recorder.analysis.production import (
    Production,
    demand_watts,
    idle_watts,
    levers,
    production_of,
)
from ir_recorder.analysis.tending import Span
from ir_recorder.report import report_html, robots
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_members import fleet_columns, member_of
from ir_recorder.report.prices import Costs
from ir_recorder.report.robots import (
    common_cycle,
    common_demand,
    common_peak,
    driven_joules,
    predicted_joules,
    robots_html,
)
from ir_recorder.report.side_by_side import comparison_html
from ir_recorder.report.step_table import write_table
from ir_recorder.report.tables import savings_lines


def _reader() -> ModuleType:
    path = Path(__file__).with_name("page_figures.py")
    spec = importlib.util.spec_from_file_location("page_figures", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["page_figures"] = module
    spec.loader.exec_module(module)
    return module


READ = _reader()
HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
AWAY = np.radians([25.0, -70.0, 95.0, 0.0, 55.0, 20.0])
# of runs: without movements, and with most; and of prices
SEEDS = [0, 3, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 2))]


def drawn(new_run: Callable[[], Any], seed: int) -> Any:
    """A run of drawn length: without movements, of one motion, or of several and pauses."""
    draw = np.random.default_rng(seed)
    run = new_run()
    run.rest(0.3, Mode.STAND_ON_MOTORS, HOME, "gripper")
    movements = (0, 1, 2, 4)[seed]
    for k in range(movements):
        ends = (HOME, AWAY) if k % 2 == 0 else (AWAY, HOME)
        step = PlannedMovement(kind="regional", from_station=f"s{k}", to_station=f"s{k + 1}")
        run.move(float(draw.uniform(0.8, 2.0)), *ends, "gripper", step)
    stands = HOME if movements % 2 == 0 else AWAY
    for mode in ("STAND_ON_MOTORS", "BUS_POWER_OFF"):
        run.pause(float(draw.uniform(0.3, 1.0)), Mode[mode], stands, "gripper", "home", mode)
    return run


@pytest.fixture(scope="module", params=SEEDS)
def walked(
    request: pytest.FixtureRequest,
    new_runs: Callable[[], Any],
    tmp_path_factory: pytest.TempPathFactory,
) -> Analysis:
    """Recordings of drawn programs, with pauses at full length or shortened."""
    path = tmp_path_factory.mktemp("walk") / "robot.mcap"
    recording = read_recording(drawn(new_runs, request.param).record(path))
    facts = (("unshortened_pauses", "600 s, 1800 s"),) if request.param % 2 else ()
    return analyse(replace(recording, facts=facts))


def costs_of(seed: int) -> Costs:
    draw = np.random.default_rng(seed).uniform
    return Costs(price=draw(0.1, 0.4), shift_hours=draw(4.0, 8.0), demand_price=draw(10.0, 100.0))


def cycles_of(seconds: float, costs: Costs) -> tuple[float, float]:
    """Cycles of a shift and of a year."""
    shift = costs.shift_hours * 3600.0 * costs.availability / seconds
    return shift, shift * costs.shifts_per_day * costs.days_per_year


def demand_of_year(analysis: Analysis, cycle: Production) -> float:
    """The most of shifts, and of rest on closed brakes outside of them [W]."""
    return max(demand_watts(analysis, cycle), idle_watts(analysis)["STAND_ON_BRAKES"])


def quantities(analysis: Analysis, cycle: Production, costs: Costs) -> dict[str, float]:
    """What the pages show under these names, computed once, here."""
    cycles, year = cycles_of(cycle.pace, costs)
    price = costs.production_price / 3.6e6
    found = {
        "a year of such cycles": cycle.energy * year * price,
        "costs a year in shifts, planned": cycle.energy * year * price,
        "costs a year in shifts, as driven": cycle.energy * year * price,
        "costs in shifts a year": cycle.energy * year * price,
        "robot: costs in shifts a year": cycle.energy * year * price,
        f"{cycle.name}: a year": cycle.energy * year * price,
        f"{cycle.name}: a shift": cycle.energy * cycles * price,
        f"{cycle.name}: a cycle": cycle.energy,
        "a cycle: robot": cycle.energy,
        "robot: energy a part": cycle.energy / costs.parts_per_cycle,
        "energy a year": cycle.energy * year,
        "all: costs in shifts a year": cycle.energy * year * price,
        "robot: cycle": cycle.seconds,
        "robot: largest quarter of an hour": demand_of_year(analysis, cycle),
        "largest quarter of an hour": demand_of_year(analysis, cycle),
        "peak power": analysis.peak_power,
        "peak power: robot": analysis.peak_power,
        "a year of such cycles: robot": cycle.energy * year * price,
    }
    for lever in levers(analysis):
        found[f"{lever.name}: a cycle, at most"] = lever.joules
        found[f"{lever.name}: a year, at most"] = lever.joules * year * price
        found[f"{lever.name}: a year, at most a year"] = lever.joules * year * price
        found[f"{lever.name}: all a year"] = lever.joules * year
    if cycle.savings is not None:
        _, of_plan = cycles_of(cycle.savings.total.seconds, costs)
        saved = abs(cycle.savings.total.saved) * of_plan * price
        found |= {
            "saved together: a year": saved,
            "saved by its plan, a year: robot": saved,
            "robot: saved a year, predicted": saved,
            "saved a year by plans, predicted": saved,
        }
    if analysis.program is not None:
        found["program: robot"] = analysis.program.whole.energy
        found["its time: robot"] = analysis.program.whole.seconds
    return found


@pytest.mark.sampled
@pytest.mark.parametrize("seed", SEEDS)
def test_figures_of_one_name_are_one_value_on_every_page(walked: Analysis, seed: int) -> None:
    costs = costs_of(seed)
    checks = findings(walked)
    cycle = production_of(walked)
    member = member_of(walked, "robot")
    assert cycle is not None
    assert member is not None
    own = replace(walked, recording=replace(walked.recording, path=Path("robot.mcap")))
    other = replace(walked, recording=replace(walked.recording, path=Path("other.mcap")))
    pages = {
        "report": report_html(walked, checks, costs=costs),
        "compare": comparison_html([(own, checks), (other, checks)], costs=costs),
        "fleet": fleet_html([member], costs=costs),
    }
    shown = {name: READ.figures_of(page) for name, page in pages.items()}
    exact = quantities(walked, cycle, costs)
    seen = set()
    for name, figures in shown.items():
        assert len(figures) > 10, name
        for figure in figures:
            if figure.name in exact and figure.kind != "%":
                seen.add(figure.name)
                assert figure.shows(exact[figure.name]), (name, figure, exact[figure.name])
    assert {
        "costs a year in shifts, as driven",
        "robot: costs in shifts a year",
        "a cycle: robot",
    } <= seen
    once = [figure for figures in shown.values() for figure in figures if _once(figure, figures)]
    for figure in once:
        alike = [each for each in READ.called(once, figure.name) if each.kind == figure.kind]
        assert all(figure.agrees(each) for each in alike), (figure, alike)


def _once(figure: Any, figures: list[Any]) -> bool:
    """Whether one place of a page has this name: rows of one name are several steps or flows."""
    return sum((each.name, each.kind) == (figure.name, figure.kind) for each in figures) == 1


def test_steps_are_the_same_on_pages_and_in_files(walked: Analysis, tmp_path: Path) -> None:
    page = report_html(walked, findings(walked))
    every = READ.figures_of(page)
    write_table([walked], tmp_path / "steps.csv")
    write_table([walked], tmp_path / "steps_de.csv", locale="de")
    with (tmp_path / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with (tmp_path / "steps_de.csv").open(newline="", encoding="utf-8-sig") as file:
        german = list(csv.DictReader(file, delimiter=";"))
    assert len(rows) == len(german) == len(walked.steps)
    origin = walked.recording.origin
    for row, other, result in zip(rows, german, walked.steps, strict=True):
        assert float(row["energy_j"]) == result.energy
        assert float(other["energy_j"].replace(",", ".")) == result.energy
        cells = READ.called(every, f"{row['step']}: {origin}")
        assert any(cell.shows(result.energy) for cell in cells if cell.kind == "J"), row


def test_robots_and_months_of_a_fleet_are_sums_of_their_recordings(walked: Analysis) -> None:
    costs = costs_of(1)
    member = member_of(walked, "robot")
    cycle = production_of(walked)
    assert member is not None
    assert cycle is not None
    fleet = [
        replace(member, robot=robot, month=month)
        for robot in ("first", "second")
        for month in ("2026-01", "2026-02", "2026-03")
    ]
    found = READ.figures_of(fleet_html(fleet, costs=costs))
    year = costs.energy_of_year(cycle).value
    (one,) = [f for f in READ.called(found, "first: costs in shifts a year") if f.kind == "EUR"]
    (both,) = [f for f in READ.called(found, "all: costs in shifts a year") if f.kind == "EUR"]
    assert one.shows(costs.money(year))
    assert both.shows(2.0 * costs.money(year))
    for month in ("2026-01", "2026-02", "2026-03"):
        driven = READ.called(found, f"{month}: driven")
        if np.isfinite(member.driven - member.predicted):
            assert [figure.shows(2.0 * member.driven) for figure in driven] == [True]
    columns = fleet_columns(fleet)
    whole = [
        energy
        for what, energy in zip(columns["what"], columns["energy_j"], strict=True)
        if what == "cycle"
    ]
    assert whole == [cycle.energy] * 6


def test_several_robots_are_sums_of_each(walked: Analysis) -> None:
    both = {"left": walked, "right": walked}
    found = READ.figures_of(robots_html(both, findings(walked)))
    exact = {
        "left: energy": driven_joules(walked),
        "left: predicted": predicted_joules(walked),
        "left: peak": walked.peak_power,
        "all together: energy": 2.0 * driven_joules(walked),
        "all together: predicted": 2.0 * predicted_joules(walked),
        "all together: peak": common_peak(both),
        "common peak": common_peak(both),
        "largest quarter of an hour": max(
            common_demand(both), 2.0 * idle_watts(walked)["STAND_ON_BRAKES"]
        ),
    }
    cycle = common_cycle(both)
    assert cycle is not None
    assert cycle.energy == pytest.approx(2.0 * driven_joules(walked))
    _, cycles = cycles_of(cycle.seconds, Costs())
    exact["energy a part"] = cycle.energy
    exact["all together: a part"] = cycle.energy
    exact["costs a year in shifts, as driven"] = (
        cycle.energy * cycles * Costs().production_price / 3.6e6
    )
    mean = cycle.energy / cycle.seconds
    assert mean <= common_demand(both) < 1.2 * mean  # cycles are much shorter than the quarter
    for name, value in exact.items():
        (figure,) = READ.called(found, name)
        assert figure.shows(value), (figure, value)


def test_a_program_of_several_cycles_costs_by_its_cycles(walked: Analysis) -> None:
    """Three cycles in one program were one, and a part took three times its energy."""
    facts = (*walked.recording.facts, ("cycles", "3"))
    bare = replace(walked.recording, savings=())  # nobody holds several robots against a program
    program = replace(walked.program, unshortened=None)
    whole = replace(walked, recording=bare, program=program)
    made = replace(whole, recording=replace(bare, facts=facts))
    once = production_of(whole)
    thrice = production_of(made)
    assert once is not None
    assert thrice is not None
    assert (thrice.cycles, thrice.energy) == (3.0, pytest.approx(once.energy / 3.0))
    costs = Costs()
    assert costs.energy_of_year(thrice).value == pytest.approx(costs.energy_of_year(once).value)
    both = {"left": made, "right": made}
    cycle = common_cycle(both)
    assert cycle is not None
    found = READ.figures_of(robots_html(both, findings(made)))
    (part,) = READ.called(found, "energy a part")
    assert part.shows(cycle.energy)
    assert cycle.energy == pytest.approx(2.0 * driven_joules(made) / 3.0)


def test_of_a_route_a_cycle_is_that_of_a_part(
    walked: Analysis, tended: Callable[[Analysis], Analysis]
) -> None:
    """What a part costs was what the whole run had cost, however many it had made."""
    whole = replace(walked, recording=replace(walked.recording, facts=()))
    whole = replace(whole, program=replace(whole.program, unshortened=None))
    made = tended(whole)
    assert made.tending is not None
    assert made.program is not None
    cycle = production_of(made)
    assert cycle is not None
    steady = made.tending.steady
    assert steady
    assert cycle.energy == pytest.approx(sum(part.joules for part in steady) / len(steady))
    assert sum(share.energy for share in cycle.modes.values()) == pytest.approx(cycle.energy)
    assert "more outside of their times" not in report_html(made, findings(made))
    more = replace(made.program.whole, energy=made.program.whole.energy + 36_000.0)
    longer = replace(made, program=replace(made.program, whole=more))
    assert "the run 10 Wh more outside of their times" in report_html(longer, findings(longer))
    costs = costs_of(2)
    found = READ.figures_of(report_html(made, findings(made), costs=costs))
    rows = {f"{part.number}": part for part in made.tending.parts}
    for name, part in rows.items():
        for head, exact in (("energy", part.joules), ("predicted", part.planned_joules)):
            shown = READ.called(found, f"{name}: {head}")
            assert any(figure.shows(exact) for figure in shown), (shown, exact)
    _, year = cycles_of(cycle.seconds, costs)
    figures = READ.called(found, f"{cycle.name}: a cycle", f"{cycle.name}: a part")
    assert figures
    for figure in figures:
        price = cycle.energy * costs.production_price / 3.6e6
        assert figure.shows({"J": cycle.energy, "EUR": price, "s": cycle.seconds}[figure.kind])
    exact = cycle.energy * year * costs.production_price / 3.6e6
    yearly = [f for f in READ.called(found, "costs a year in shifts, as driven") if f.kind == "EUR"]
    assert yearly
    assert all(figure.shows(exact) for figure in yearly)


def test_the_terminal_says_what_the_pages_show(walked: Analysis) -> None:
    cycle = production_of(walked)
    program = walked.program
    assert cycle is not None
    assert program is not None
    totals = {
        "this run": {"J": program.whole.energy, "s": program.whole.seconds},
        "with full pauses": {"J": cycle.energy, "s": cycle.seconds},
    }
    said = DemoOutcome(walked, findings(walked)).text().splitlines()
    seen = set()
    for line in said:
        start = next((name for name in totals if line.startswith(name)), "")
        for figure in READ.figures_in(line.partition(";")[0], start) if start else ():
            exact = totals[start][figure.kind]
            assert figure.shows(exact), (line, exact)
            seen.add(start)
    assert "this run" in seen
    assert any("computed: pauses at full length" in line for line in said) == (
        cycle.computed is not None
    )
    assert walked.savings is not None
    total = next(line for line in savings_lines(walked) if line.startswith("total:"))
    joules = [figure for figure in READ.figures_in(total, "total") if figure.kind == "J"][:2]
    for figure, exact in zip(
        joules, (walked.savings.total.planned, walked.savings.total.common), strict=True
    ):
        assert figure.shows(exact), total


def test_the_page_of_robots_names_at_its_top_what_holds_between_them(walked: Analysis) -> None:
    """A sentence listed all 302 checks of both robots: six sheets of A4."""
    between = Finding("distance of left and right", 0.9, 0.0, 2.0, "m", "", 0.0)
    own = [replace(each, name=f"left: {each.name}") for each in findings(walked)]
    page = READ.plain(robots_html({"left": walked, "right": walked}, [between, *own]))
    sure = page.split('<div class="sure">')[1].partition("</div>")[0]
    assert "distance of left and right 900.0 mm" in sure
    assert "left: " not in sure
    assert all(f"left: {each.name}".split()[1] in page for each in findings(walked))


@pytest.mark.parametrize("late", [0.0, 1.0])
def test_robots_that_are_in_a_zone_together_are_marked(
    walked: Analysis, monkeypatch: pytest.MonkeyPatch, late: float
) -> None:
    start = walked.steps[0].step.start
    passes = {"left": [Span(start, start + 1.0 + late)], "right": [Span(start + 1.0, start + 3.0)]}
    monkeypatch.setattr(robots, "zone_passes", lambda _: {"zone_1": passes})
    page = robots_html({"left": walked, "right": walked}, ())
    chart = page.split('<svg class="gantt" id="robots"')[1]
    assert ('class="late"' in chart) == (late > 0.0)
    if late:
        assert "left and right together, 1.00 s" in chart
