"""The page of a comparison, its table, and the command."""

from __future__ import annotations

import base64
import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from ir_cli.compare import row_of
from ir_cli.main import main
from ir_msgs_py.savings import BeforeAfter, Saving
from ir_planner import Planner
from ir_recorder.analysis.production import home_watts
from ir_recorder.report.before_after import (
    before_after_columns,
    before_after_html,
    quarter_of,
    write_before_after_table,
    year_of,
)
from ir_recorder.report.money_text import money
from ir_recorder.report.motion_scene import common_rests, in_step
from ir_recorder.report.number_text import (
    kilograms,
    kilowatt_hours,
    millimetres,
    span_of,
    watts,
)
from ir_recorder.report.prices import J_PER_KWH, Costs


def data_of(page: str) -> dict:
    return json.loads(page.partition('id="data">')[2].partition("</script>")[0])


def test_the_page_has_both_motions_and_all_figures(compared: BeforeAfter, planner: Planner) -> None:
    page = before_after_html(compared, planner.cell)
    data = data_of(page)
    assert [side["name"] for side in data["sides"]] == [
        "today",
        "same cycle time",
        "free",
        "for the line",
    ]
    today = data["sides"][0]
    angles = (
        np.frombuffer(base64.b64decode(today["jointValues"]), "<i2").reshape(-1, 6)
        * today["jointSteps"]
    )
    assert angles[0] == pytest.approx(planner.cell.machine_home, abs=2e-4)
    first = compared.today.movements[0].trajectory
    assert first is not None
    row = round(0.3 / today["step"])
    assert angles[row] == pytest.approx(
        first.sample(np.array([row * today["step"]])).q[0], abs=2e-4
    )
    (curves,) = data["axes"]
    high = np.frombuffer(base64.b64decode(curves["high"]), "<i2").reshape(-1, 4) * curves["step"]
    peaks = [side.report.peak_power for side in (compared.today, *compared.sides)]
    assert high.max(axis=0) == pytest.approx(peaks, rel=1e-3)
    for words in ("saved a year", "CO2", "peak power", "pause at point_2", "0.2 EUR/kWh"):
        assert words in page


def plain(page: str) -> str:
    """The page without the elements of its amounts of money."""
    return re.sub(r"</?data[^>]*>", "", page)


def test_the_headline_has_money_energy_and_co2_of_shifts_and_nights(
    compared: BeforeAfter, planner: Planner
) -> None:
    """Once the money was that of nights too, the energy and CO2 beside it those of shifts alone."""
    costs = Costs(price=0.27, grid=0.41, demand_price=80.0)
    page = before_after_html(compared, planner.cell, costs)
    year = year_of(compared, compared.planned, costs).saved.value
    power = home_watts(
        planner.cell, compared.planned.movements[-1].load, planner.cell.robot.controller
    )
    night = power["STAND_ON_BRAKES"] - power["HIBERNATION"]
    joules = year + night * costs.idle_hours * 3600.0
    answer = plain(page).split('<section id="answer">')[1].partition("</section>")[0]
    assert f"<b>{money(joules / J_PER_KWH * 0.27, 'EUR')} less a year</b>" in answer
    assert f"{kilowatt_hours(joules)}, {kilograms(costs.co2(joules))} CO2 less" in answer
    assert "from the data sheet, not measured" in page
    assert "1. at night and at weekends" in page
    assert "2. " in page.split("1. at night and at weekends")[1]


def test_the_largest_quarter_of_an_hour_is_compared(
    compared: BeforeAfter, planner: Planner
) -> None:
    page = before_after_html(compared, planner.cell)
    row = page.split(">largest quarter of an hour</td>")[1].split("</tr>")[0]
    for side in (compared.today, compared.planned):
        mean = side.report.energy / side.report.duration
        assert mean <= quarter_of(side) <= side.report.peak_power
        assert watts(quarter_of(side)) in row
    controller = planner.cell.robot.controller
    rests = home_watts(planner.cell, compared.planned.movements[-1].load, controller)
    priced = before_after_html(compared, planner.cell, Costs(demand_price=100.0))
    largest = max(quarter_of(compared.planned), rests["HIBERNATION"])
    assert f"<b>{watts(largest)}</b>" in row
    assert money(largest / 10.0, "EUR") in priced
    # today's controller rests on closed brakes at night, and what is said counts all hours
    before = max(quarter_of(compared.today), rests["STAND_ON_BRAKES"])
    assert f"<b>{watts(before)}</b>" in row
    assert watts(rests["HIBERNATION"]) in row
    assert "at night and at weekends" in row


@pytest.mark.parametrize("seed", range(4))
def test_changes_add_up_to_what_is_saved_together(
    compared: BeforeAfter, planner: Planner, seed: int
) -> None:
    price = float(np.random.default_rng(seed).uniform(0.05, 2.0))
    page = plain(before_after_html(compared, planner.cell, Costs(price=price)))
    table = page.split(">Changes</caption>")[1].partition("</table>")[0]
    rows = re.findall(r"<tr>(.*?)</tr>", table.partition("<tbody>")[2], re.DOTALL)
    years = [re.findall(r"(-?[\d.\s]*\d) EUR(?:</b>|</td>)", row) for row in rows]
    digits = [re.sub(r"\s", "", year[0]) if year else "0" for year in years]
    *parts, whole = map(float, digits)
    assert len(parts) > 2
    halves = sum(0.5 * 10.0 ** -len(each.partition(".")[2]) for each in digits)
    assert sum(parts) == pytest.approx(whole, abs=halves)  # each is rounded by itself
    said = re.findall(r"at night and at weekends: ([\d.\s]+) EUR", page)
    assert [float(re.sub(r"\s", "", each)) for each in said] == parts[:1]


def test_an_interval_with_zero_in_it_says_so(compared: BeforeAfter, planner: Planner) -> None:
    doubtful = tuple(
        replace(side, moving=replace(side.moving, saved_low=-1e6)) for side in compared.sides
    )
    page = before_after_html(replace(compared, sides=doubtful), planner.cell)
    assert "zero lies in it: it is open whether anything is saved" in page
    assert "zero lies in it" not in before_after_html(compared, planner.cell)


def test_a_program_that_takes_more_is_no_saving(compared: BeforeAfter, planner: Planner) -> None:
    """Once "-2.8 %" were saved: what isn't saved is taken more, in every figure."""
    worse = replace(compared.planned.saving, planned=1.028 * compared.planned.saving.common)
    worse = replace(worse, saved_low=1.1 * worse.saved, saved_high=0.9 * worse.saved)
    sides = tuple(replace(side, moving=worse, resting=Saving()) for side in compared.sides)
    page = before_after_html(replace(compared, sides=sides, changes=()), planner.cell)
    for words in ("more a cycle", "2.8 % more", "No change saves as much"):
        assert words in page
    assert "saved a cycle</span>" not in page
    assert "-2.8 %" not in page


def test_names_of_a_program_cannot_write_into_the_page(
    compared: BeforeAfter, planner: Planner
) -> None:
    page = before_after_html(
        replace(compared, name="<script>x()", notes=("</script>",)), planner.cell
    )
    assert "<script>x()" not in page
    assert page.count("</script>") == 2


def test_the_table_has_the_years_of_the_costs(compared: BeforeAfter, tmp_path: Path) -> None:
    columns = before_after_columns(compared, Costs(price=0.5))
    row = columns["program"].index("same cycle time")
    side = compared.sides[0]
    cycles = 8 * 3600 * 0.85 * 2 * 240 / compared.today.report.duration
    assert columns["year_saved_money"][row] == pytest.approx(
        cycles * side.saving.saved / 3.6e6 * 0.5
    )
    path = write_before_after_table(compared, tmp_path / "table.csv")
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(columns["program"])
    assert float(rows[row]["energy_j"]) == side.report.energy
    stored = parquet.read_table(
        write_before_after_table(compared, tmp_path / "table.parquet", Costs(price=0.5))
    )
    np.testing.assert_equal(stored.to_pydict(), columns)


def test_every_amount_of_the_table_follows_from_the_joules(compared: BeforeAfter) -> None:
    """By their own arithmetic: shifts, years, money and CO2 with their intervals, and sums over the
    steps.
    """
    costs = Costs(
        price=0.31,
        grid=0.12,
        shift_hours=7.5,
        shifts_per_day=3,
        days_per_year=300,
        availability=0.9,
    )
    columns = before_after_columns(compared, costs)
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    wholes = [row for row in rows if row["what"] == "cycle"]
    assert len(wholes) == 4
    for whole in wholes:
        cycle_time = 60.0 if whole["program"] == "for the line" else wholes[0]["seconds_s"]
        cycles = 7.5 * 3600 * 0.9 / cycle_time
        assert whole["shift_cycles"] == pytest.approx(cycles)
        for end in ("", "_low", "_high"):
            kwh = whole[f"energy{end}_j"] / 3.6e6
            assert whole[f"shift_kwh{end}"] == pytest.approx(kwh * cycles)
            assert whole[f"year_kwh{end}"] == pytest.approx(kwh * cycles * 900)
            assert whole[f"year_money{end}"] == pytest.approx(kwh * cycles * 900 * 0.31)
            assert whole[f"year_co2_kg{end}"] == pytest.approx(kwh * cycles * 900 * 0.12)
            saved = whole[f"saved{end}_j"] / 3.6e6
            assert whole[f"year_saved_money{end}"] == pytest.approx(saved * cycles * 900 * 0.31)
        assert (
            0.0
            < whole["peak_low_w"]
            <= whole["peak_w"]
            <= whole["peak_high_w"]
            < 2.0 * whole["peak_w"]
        )
        own = [row for row in rows if row["program"] == whole["program"] and row["what"] != "cycle"]
        steps = [row for row in own if not row["what"].startswith("change")]
        for name in ("seconds_s", "energy_j"):
            assert sum(row[name] for row in steps) == pytest.approx(whole[name])
    changes = [row for row in rows if row["what"].startswith("change")]
    assert [row["saved_j"] for row in changes] == [
        change.saving.saved for change in compared.changes
    ]


def test_every_figure_is_one_value_on_the_page_in_the_table_and_of_the_command(
    compared: BeforeAfter, planner: Planner
) -> None:
    """The page and the command round what the table holds in full."""
    costs = Costs(price=0.27, grid=0.41, parts_per_cycle=3.0)
    columns = before_after_columns(compared, costs)
    page = before_after_html(compared, planner.cell, costs)
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    wholes = [row for row in rows if row["what"] == "cycle"]
    sides = [compared.today, *compared.sides]
    for row, side in zip(wholes, sides, strict=True):
        said = row_of(side)
        joules_shown = [row[f"energy{end}_j"] for end in ("", "_low", "_high")]
        assert [said["joules"], said["joules_low"], said["joules_high"]] == joules_shown
        assert said["peak_watts"] == row["peak_w"]
        assert said["clearance"] == row["clearance_m"]
        shown = [
            kilowatt_hours(joules_shown[0]),
            span_of(*joules_shown[1:], kilowatt_hours),
            kilowatt_hours(row["year_kwh"] * J_PER_KWH),
            money(row["year_money"], "EUR"),
            kilograms(row["year_co2_kg"]),
            watts(row["peak_w"]),
            millimetres(row["clearance_m"]),
        ]
        if side is not compared.today:
            assert said["saved_joules"] == row["saved_j"]
            shown += [kilowatt_hours(row["saved_j"]), money(row["year_saved_money"], "EUR")]
        assert [figure for figure in shown if figure not in page] == []
    changes = [row for row in rows if row["what"].startswith("change")]
    table = plain(page).split(">Changes</caption>")[1].partition("</table>")[0]
    years = re.findall(r"<b>(-?[\d.\s]*\d) EUR</b>", table)
    for row in changes:  # parts of a sum: none is off by as much as the last digit
        near = [abs(float(re.sub(r"\s", "", each)) - row["year_saved_money"]) for each in years]
        assert min(near) < 1.0


def test_a_program_that_is_too_slow_for_the_cycles_says_so(
    compared: BeforeAfter, planner: Planner
) -> None:
    assert "fit: it is slower" not in before_after_html(compared, planner.cell)
    free = compared.sides[1]
    slow = replace(free, report=replace(free.report, duration=1.5 * compared.today.report.duration))
    page = before_after_html(replace(compared, sides=(compared.sides[0], slow)), planner.cell)
    assert "only 324 fit: it is slower" in page


def test_the_command_writes_the_page_and_prints_the_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    old = Path(__file__).parent / "old.src"
    arguments = ["compare", "open", str(old), "-o", str(page), "--json"]
    assert main(arguments) == 0
    answer = json.loads(capsys.readouterr().out)
    assert [row["program"] for row in answer["programs"]] == ["today", "same cycle time", "free"]
    assert answer["programs"][1]["saved_low"] > 0.0
    assert page.read_text(encoding="utf-8").startswith("<!doctype html>")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["open", "there.pdf"], 2, "today's program is read from .src"),
        (["open", "missing.src"], 2, "missing.src: No such file"),
        (["open", "missing.src", "--process", "line 3"], 2, "it must be lines as 5-9"),
        (["open", "trace.csv", "--process", "5"], 2, "--process names lines of a KRL program"),
        (["open", "missing.src", "--stations", "p1"], 2, "--stations are of PTP at 100 %"),
        (["open", "--stations", "nowhere"], 2, "nowhere"),
        (["open", "--costs", "no.yaml"], 1, "no.yaml"),
    ],
)
def test_what_makes_no_sense_is_a_sentence(
    arguments: list[str], code: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", *arguments]) == code
    assert words in capsys.readouterr().err


def test_curves_of_both_programs_are_in_step_at_every_stop(compared: BeforeAfter) -> None:
    """Once they drifted apart, and a pause of 180 s was cut to what both had of it together."""
    sides = [compared.today, *compared.sides]
    drawn = in_step(sides)
    ends = []
    for each, side in zip(drawn, sides, strict=True):
        starts = np.cumsum([0.0, *(hop.seconds for hop in side.hops)])[:-1]
        alike = min(len(starts), len(drawn[0].there))  # one may wait at its end
        assert each.at(starts)[:alike] == pytest.approx(drawn[0].there[:alike])
        times = np.linspace(0.0, side.report.duration, 500)
        assert (np.diff(each.at(times)) >= 0.0).all()
        ends.append(each.end)
    assert max(ends) >= max(side.report.duration for side in sides)
    longest = max(hop.seconds for hop in compared.today.hops if hop.is_pause)
    rests = common_rests(sides)
    assert max((end - start for start, end in rests), default=longest) == pytest.approx(longest)


_YEARLY = re.compile(r'data-head="saved a year">(?:<b>)?([\d .]+) EUR')


def test_what_to_change_adds_up_to_the_result(compared: BeforeAfter, planner: Planner) -> None:
    """Once the table ended with the last change, and nothing said what all of them are together."""
    page = plain(before_after_html(compared, planner.cell, Costs(price=20.0)))
    changes = page.split('<section id="changes">')[1].partition("</section>")[0]
    *parts, whole = [float(each.replace(" ", "")) for each in _YEARLY.findall(changes)]
    assert len(parts) == len(compared.changes) + 2  # nights, and all other changes
    assert sum(parts) == pytest.approx(whole, abs=0.5 * len(parts))
    assert f"<b>{whole:,.0f} EUR less a year</b>".replace(",", " ") in page


def test_a_program_that_hardly_differs_is_no_column(
    compared: BeforeAfter, planner: Planner
) -> None:
    same, free = compared.sides[:2]
    energy = 1.005 * same.report.energy
    near = replace(same.report, energy=energy, duration=same.report.duration)
    page = before_after_html(
        replace(compared, sides=(same, replace(free, report=near))), planner.cell
    )
    figures = page.split('id="figures"')[1].partition("</section>")[0]
    assert ">planned program, free</th>" not in figures
    assert "differ by less than 1 %" in figures
    assert ">planned program, free</th>" in before_after_html(compared, planner.cell)


def test_the_head_says_what_is_proved(compared: BeforeAfter, planner: Planner) -> None:
    head = before_after_html(compared, planner.cell).partition("<main>")[0]
    assert 'class="verdict good"' in head
    assert "mm kept, within limits" in head
    assert "nothing driven" in head
