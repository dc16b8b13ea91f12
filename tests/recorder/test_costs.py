"""What a cycle costs: right by its own arithmetic, and every assumption named as one."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_description import load_cell
from ir_recorder import Analysis, analyse
from ir_recorder.analysis.production import (
    DRIVES_ONLY,
    OPEN,
    Amount,
    demand_watts,
    idle_watts,
    levers,
    production_of,
)
from ir_recorder.errors import RecorderError
from ir_recorder.report import report_html
from ir_recorder.report.cycle_costs import costs_section, lever_section, payback
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_figures import fleet_of_line
from ir_recorder.report.fleet_members import member_of
from ir_recorder.report.money_text import money, yearly_money, yearly_span
from ir_recorder.report.nights import clock_section, idle_saving, recorded_idle_saving
from ir_recorder.report.number_text import kilograms, kilowatt_hours, watts
from ir_recorder.report.paid import with_span
from ir_recorder.report.prices import NAMES, Costs, assumed_section, counted_with, read_costs
from ir_recorder.report.quarter_hour import demand_of, recorded_demand
from ir_recorder.report.side_by_side import comparison_html
from ir_values.settings import settings_table

GIVEN = """format: ir_costs/1
price: 0.5
currency: CHF
grid: 0.1
shift_hours: 10
shifts_per_day: 1
days_per_year: 100
parts_per_cycle: 2
availability: 1.0
first_shift: 7
night_from: 21
night_to: 5
price_night: 0.5
demand_price: 80
engineer_hour: 90
line_robots: 30
line_stand_by: 10
line_technology: 20
line_infrastructure: 40
"""


def test_a_file_says_what_a_joule_costs(tmp_path: Path) -> None:
    path = tmp_path / "costs.yaml"
    path.write_text(GIVEN)
    costs = read_costs(path)
    assert costs.money(7.2e6) == pytest.approx(1.0)
    assert costs.co2(7.2e6) == pytest.approx(0.2)
    assert costs.cycles_per_shift(60.0) == pytest.approx(600.0)
    assert costs.cycles_per_year(60.0) == pytest.approx(60_000.0)
    assert set(costs.given) == set(NAMES)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("price: 0.2", "begins with format"),
        ("format: ir_costs/1\nprize: 0.2", "prize is unknown, known are price"),
        ("format: ir_costs/1\nprice: cheap", "must be a number"),
        ("format: ir_costs/1\nprice: true", "must be a number"),
        ("format: ir_costs/1\nprice: 0,24", "must be a number: write 0.24"),
        ("format: ir_costs/1\nprice: -1", "price is -1"),
        ("format: ir_costs/1\nprice: .nan", "must be finite"),
        ("format: ir_costs/1\navailability: 2", "availability is 2"),
        ("format: ir_costs/1\ncurrency: 12", "must be a text"),
        (
            "format: ir_costs/1\nprice: 1\nprice: 2",
            r"yaml:3: 'price' stands here twice",
        ),
        ("format: [", "costs.yaml"),
        ("[" * 5000, "costs.yaml"),
        (
            "format: ir_costs/1\nshift_hours: 12\nshifts_per_day: 3",
            "together they must be at most 24 h a day",
        ),
        ("format: ir_costs/1\nline_robots: 30", r"add up to 104.5 %, must be 100 %"),
        ('format: ir_costs/1\ncurrency: "a\\nb"', "at most 12 characters in one line"),
        ("format: ir_costs/1\ncurrency: '  '", "at most 12 characters in one line"),
    ],
)
def test_a_file_that_makes_no_sense_is_a_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "costs.yaml"
    path.write_text(text)
    with pytest.raises(RecorderError, match=words):
        read_costs(path)


@pytest.mark.parametrize("seed", range(20))
def test_prices_by_day_and_night_are_means_over_the_minutes_of_a_day(seed: int) -> None:
    """Judge: each minute of a working day and of a free day, with the price of its hour."""
    draw = np.random.default_rng(seed)
    shifts = draw.choice([1.0, 2.0, 3.0])
    costs = Costs(
        price=0.3,
        price_night=0.1,
        shift_hours=float(draw.integers(1, int(24.0 / shifts) + 1)),
        shifts_per_day=float(shifts),
        days_per_year=float(draw.integers(1, 366)),
        first_shift=float(draw.integers(0, 25)),
        night_from=float(draw.integers(0, 25)),
        night_to=float(draw.integers(0, 25)),
    )
    minute = (np.arange(1440) + 0.5) / 60.0
    length = (costs.night_to - costs.night_from) % 24.0
    price = np.where((minute - costs.night_from) % 24.0 < length, 0.1, 0.3)
    work = (minute - costs.first_shift) % 24.0 < costs.shift_hours * costs.shifts_per_day
    assert costs.production_price == pytest.approx(price[work].mean())
    free = 365.0 - costs.days_per_year
    hours = (~work).sum() * costs.days_per_year + 1440.0 * free
    paid = price[~work].sum() * costs.days_per_year + price.sum() * free
    assert costs.idle_hours == pytest.approx(hours / 60.0)
    if hours > 0.0:
        assert costs.idle_price == pytest.approx(paid / hours)


@pytest.mark.parametrize("seed", range(5))
def test_cycles_stops_and_nights_are_all_hours_of_a_year(seed: int) -> None:
    """Once 576 of them were neither counted nor named."""
    draw = np.random.default_rng(seed).uniform
    costs = Costs(availability=draw(0.3, 0.99), shift_hours=draw(4.0, 12.0))
    pace = draw(10.0, 4000.0)
    in_cycles = costs.cycles_per_year(pace) * pace / 3600.0
    assert in_cycles + costs.standing_hours + costs.idle_hours == pytest.approx(8760.0)
    said = f"the {costs.standing_hours:,.0f} h a year".replace(",", " ")
    assert said in counted_with(costs)
    assert "stands still" not in counted_with(replace(costs, availability=1.0))


def test_the_largest_quarter_of_an_hour_lies_between_mean_and_largest_step(
    analysis: Analysis,
) -> None:
    for fact in ("", "600 s, 1800 s"):
        facts = (("unshortened_pauses", fact),) if fact else ()
        found = analyse(replace(analysis.recording, facts=facts))
        cycle = production_of(found)
        assert cycle is not None
        largest = max(share.energy / share.seconds for share in cycle.steps.values())
        assert cycle.energy / cycle.seconds * 0.99 <= demand_watts(found, cycle) <= largest


@pytest.mark.parametrize("seed", range(4))
def test_the_largest_quarter_of_an_hour_is_of_all_hours(seed: int, analysis: Analysis) -> None:
    """Nights on closed brakes, which may take more than cycles do, were left out without a word."""
    draw = np.random.default_rng(seed).uniform
    shifts, brakes, deepest = draw(100.0, 500.0), draw(100.0, 500.0), draw(5.0, 100.0)
    rests = {"STAND_ON_BRAKES": brakes, "HIBERNATION": deepest}
    for planned, rest in ((False, brakes), (True, deepest)):
        found = demand_of(shifts, rests, Costs(), planned=planned)
        assert found.watts == max(shifts, rest)
        assert watts(min(shifts, rest)) in found.words  # what the other hours take is said
        assert ("hibernation" in found.words) == planned
        whole = Costs(shift_hours=24.0, shifts_per_day=1.0, days_per_year=366.0)
        for other, costs in ((rests, whole), ({}, Costs())):
            alone = demand_of(shifts, other, costs, planned=planned)
            assert (alone.watts, alone.words) == (shifts, "in shifts alone")
    cycle = production_of(analysis)
    assert cycle is not None
    found = recorded_demand(analysis, cycle, Costs())
    rest = idle_watts(analysis)["STAND_ON_BRAKES"]
    assert found.watts == max(demand_watts(analysis, cycle), rest)
    page = report_html(analysis, ())
    tile = page.split("<span>largest quarter of an hour</span>")[1].partition("</div>")[0]
    assert f"<b>{watts(found.watts)}</b><small>{found.words}</small>" in tile
    section = clock_section(analysis, Costs())
    assert found.words in section
    assert "Waking up, and standing still within the shifts, are not in it." in section


@pytest.mark.parametrize("known", [4321.0, 0.0])
def test_peak_and_bill_of_a_fleet_are_of_the_same_programs(
    analysis: Analysis, known: float
) -> None:
    """The bill counted the common program where nobody drove a plan, the peak the plan."""
    member = member_of(analysis, "one")
    assert member is not None
    undriven = replace(
        member,
        cycle=replace(member.cycle, origin="predicted"),
        demand=1234.0,
        common_demand=known,
    )
    page = fleet_html([undriven])
    tile = page.split("<span>largest quarter of an hour</span>")[1].partition("</div>")[0]
    assert f"<b>{watts(known or 1234.0)}</b>" in tile
    assert "common program where no plan was driven" in tile
    assert ("no file says the common program" in tile) == (known == 0.0)
    driven = replace(undriven, cycle=member.cycle)
    tile = fleet_html([driven]).split("<span>largest quarter of an hour</span>")[1]
    assert "<b>1 234 W</b>" in tile.partition("</div>")[0]


def test_rest_outside_of_the_shifts_is_priced_by_mode(analysis: Analysis) -> None:
    costs = Costs(price=0.2)
    for mode, power in idle_watts(analysis).items():
        energy = power * costs.idle_hours * 3600.0
        section = clock_section(analysis, costs)
        assert mode.replace("_", " ").lower() in section
        assert money(energy / 3.6e6 * 0.2, "EUR") in section


def test_assumptions_are_marked_and_given_figures_are_not(analysis: Analysis) -> None:
    alone = assumed_section(Costs(price=0.5))
    assert "All values are assumed." in alone
    assert "0.5 EUR/kWh" in alone
    for own in (("price",), ("shift_hours", "currency"), NAMES):
        costs = replace(Costs(), price=0.5, given=own)
        origins = re.findall(
            r"<small>(\w+)</small></td><td[^>]*><b>([^<]*)</b><small>([^<]*)",
            assumed_section(costs),
        )
        assert [name for name, _, _ in origins] == list(NAMES)
        marked = {name for name, _, words in origins if words == "from your file"}
        assert marked == set(own)
        assert all(words == "assumed" for name, _, words in origins if name not in own)
        assert ("price", "0.5 EUR/kWh") in [row[:2] for row in origins]
        words = "as your file gives it" if own == NAMES else "partly assumed"
        assert words in costs_section(analysis, costs)
    assert "all assumed" in costs_section(analysis, Costs())


def test_the_cycle_is_the_one_with_full_pauses(analysis: Analysis) -> None:
    run = production_of(analysis)
    full = production_of(
        analyse(replace(analysis.recording, facts=(("unshortened_pauses", "600 s, 1800 s"),)))
    )
    assert run is not None
    assert full is not None
    assert full.seconds > 2400.0
    assert full.energy > run.energy
    assert "full pauses" in full.name


def test_markup_in_a_currency_stays_text(analysis: Analysis) -> None:
    costs = replace(Costs(), currency="<b>x</b>")
    assert "<b>x" not in costs_section(analysis, costs) + lever_section(analysis, costs)


def test_the_documentation_has_the_table_of_the_settings() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "report.md").read_text(encoding="utf-8")
    rows = [row for row in settings_table(Costs()).splitlines() if not row.startswith("| `given`")]
    assert "\n".join(rows) in page


def test_of_pauses_in_a_mode_only_what_is_above_the_deepest_one_can_be_saved(
    analysis: Analysis,
) -> None:
    """Once all of it: no robot takes less than in its deepest mode."""
    pauses = [
        r
        for r in analysis.steps
        if r.step.movement.is_pause and r.step.movement.power_mode not in ("", "STAND_ON_MOTORS")
    ]
    assert pauses
    least = min(idle_watts(analysis).values())
    assert least > 0.0
    above = sum(max(r.energy - least * r.seconds, 0.0) for r in pauses)
    found = [
        each.joules for each in levers(analysis, most=20) if each.name == "pauses in a power mode"
    ]
    cycle = production_of(analysis)
    assert cycle is not None
    assert sum(found) == pytest.approx(above / cycle.cycles, abs=1.0)
    assert sum(found) < sum(r.energy for r in pauses)


def test_without_a_program_there_is_nothing_to_pay(analysis: Analysis) -> None:
    bare = analyse(replace(analysis.recording, events=(), savings=()))
    assert costs_section(bare, Costs()) == ""
    assert lever_section(bare, Costs()) == ""
    assert clock_section(bare, Costs()) == ""


@pytest.mark.parametrize(
    ("saved", "words", "months"),
    [
        (30.0, "0.5 h", "24"),
        (60.0, "1 h", "12"),
        (1000.0, "17 h", "0.72"),
        (12.0, "0.2 h", "60"),
    ],
)
def test_a_saving_pays_for_hours_of_an_engineer(saved: float, words: str, months: str) -> None:
    costs = Costs(engineer_hour=60.0)
    year = Amount(1.0, 0.5, 1.5).times(saved)
    assert payback(year, costs) == (
        f"pays for {words} of an engineer a year (60 EUR/h), for one hour in {months} months"
    )
    assert payback(replace(year, low=-year.low), costs) == ""


def test_amounts_that_nobody_counts_are_said_in_words() -> None:
    assert yearly_money(4.3e-8, "EUR") == "practically nothing"
    assert yearly_money(0.02, "EUR") == money(0.02, "EUR")
    assert payback(Amount(0.009, 0.009, 0.009), Costs()) == ""


@given(st.floats(0.02, 1e6), st.floats(0.0, 1e6))
def test_both_ends_of_an_interval_are_rounded_alike(low: float, wide: float) -> None:
    """Once "76.19 to 123 EUR": cents beside whole euros."""
    first, last = yearly_span(low, low + wide, "EUR").replace("\u00a0", "").split(" to ")
    assert ("." in first) <= ("." in last)
    step = 0.5 if low + wide >= 10.0 else 0.005
    for shown, value in ((first, low), (last, low + wide)):
        assert abs(float(shown) - value) <= 1.01 * step


def test_zero_inside_an_interval_is_said_on_every_page(analysis: Analysis) -> None:
    (event,) = analysis.recording.savings[-1:]
    moved = replace(event.savings.movements, saved_low=-1e6, saved_high=1e6)
    savings = replace(event.savings, movements=moved)
    events = (replace(event, savings=savings, time=0.0),)
    found = analyse(replace(analysis.recording, savings=events))
    member = member_of(found, "robot")
    assert member is not None
    pages = (
        report_html(found, ()),
        comparison_html([(found, ()), (found, ())]),
        fleet_html([member]),
    )
    assert all(OPEN in page for page in pages)
    assert not any("Of the whole line" in page for page in pages)


def test_a_robot_without_figures_of_its_controller_is_in_no_sum_at_the_mains(
    analysis: Analysis,
) -> None:
    assert analysis.cell is not None
    robot = replace(analysis.cell.robot, controller=load_cell("kr6_bench").robot.controller)
    found = replace(analysis, cell=replace(analysis.cell, robot=robot))
    assert idle_watts(found) == {}
    members = [member_of(analysis, "counted"), member_of(found, "bare")]
    known = [member for member in members if member is not None]
    fleet = fleet_html(known)
    alone = fleet_html(known[:1])
    pages = (report_html(found, ()), comparison_html([(found, ()), (analysis, ())]), fleet)
    assert all(DRIVES_ONLY in page for page in pages)
    assert "In no sum" in fleet
    assert "Of the whole line" not in pages[0]
    whole = fleet_of_line(known, Costs())
    assert whole == fleet_of_line(known[:1], Costs())
    assert fleet.partition("</section>")[0].split("<main>")[1] in alone


def plain(page: str) -> str:
    """The page without the elements of its amounts of money."""
    return re.sub(r"</?data[^>]*>", "", page)


def test_a_fleet_counts_the_same_robots_in_shifts_and_at_night(
    analysis: Analysis, scattered: Callable[[Analysis, int], Analysis]
) -> None:
    """Once two robots' shifts stood beside three robots' nights."""
    analysis = scattered(analysis, 0)
    costs = Costs(price=0.2)
    member = member_of(analysis, "first")
    idle = recorded_idle_saving(analysis, costs)
    assert member is not None
    assert idle is not None
    assert member.cycle.savings is not None
    bare = replace(member, robot="second", cycle=replace(member.cycle, savings=None))
    page = plain(fleet_html([member, bare], costs=costs))
    common = costs.common_of_year(member.cycle)
    assert common is not None
    shifts = costs.money(common)
    shifts += costs.money(costs.energy_of_year(bare.cycle).value)
    picture = page.split('<section id="year">')[1].partition("</section>")[0]
    nights = 2.0 * idle.left_alone
    assert f"<b>{yearly_money(shifts + nights, 'EUR')}</b>" in picture
    assert "second alike in all: no file says what its plan saves" in picture
    driven = picture.partition(">today, nights")[2]
    today = sum(costs.energy_of_year(each.cycle).value for each in (member, bare))
    assert f"{yearly_money(costs.money(today), 'EUR')} in shifts" in driven
    assert f"{yearly_money(nights, 'EUR')} outside" in driven  # nobody recorded a night
    assert "of the saving is at night, from the data sheet" in page
    assert "Simulated, not measured" in page
    assert 'The plan of "first" instead of its common program' in unescape(page)
    assert "the 576 h a year (15 % of the shifts) in which the cell stands still" in page
    measures = page.split("<h2>What could still be saved, each by itself")[1].partition(
        "</section>"
    )[0]
    assert "at night and at weekends<small>hibernation" in measures
    assert yearly_money(2.0 * idle.saved, "EUR") in measures


def test_hibernation_outside_of_the_shifts_is_a_headline(
    analysis: Analysis, scattered: Callable[[Analysis, int], Analysis]
) -> None:
    analysis = scattered(analysis, 0)
    costs = Costs(price=0.2)
    found = recorded_idle_saving(analysis, costs)
    assert found is not None
    rest = idle_watts(analysis)
    power = rest["STAND_ON_BRAKES"] - rest["HIBERNATION"]
    assert found.saved == pytest.approx(power / 1000.0 * costs.idle_hours * 0.2)
    assert found.money.low < found.saved < found.money.high  # by the data sheet, not measured
    assert found.money.high < 2.0 * found.saved
    words = "saves {} a year, from the data sheet, not measured"
    member = member_of(analysis, "robot")
    assert member is not None
    assert words.format(money(found.saved, "EUR")) in clock_section(analysis, costs)
    assert words.format(money(found.saved, "EUR")) in plain(fleet_html([member], costs=costs))
    answers = [
        plain(page).split('<section id="answer">')[1].partition("</section>")[0]
        for page in (report_html(analysis, (), costs=costs), fleet_html([member], costs=costs))
    ]
    step = f"ibernation ({rest['HIBERNATION']:.0f} W) instead of closed brakes "
    step += f"({rest['STAND_ON_BRAKES']:.0f} W) at night and at weekends"
    for answer in answers:
        assert step in answer
        assert f": {with_span(found.money, costs)} a year" in answer
    cycle = production_of(analysis)
    assert cycle is not None
    year = costs.saving_of_year(cycle)
    assert year is not None
    common = costs.common_of_year(cycle)
    assert common is not None
    shifts = costs.money(common), costs.money(costs.energy_of_year(cycle).value)
    today = shifts[0] + found.left_alone
    then = costs.money(common - year.value) + found.deepest
    both = yearly_money(today - then, "EUR")
    energy = year.value + found.energy.value
    assert found.energy.value == pytest.approx(power * costs.idle_hours * 3600.0)
    headline = f"{kilowatt_hours(energy)}, {kilograms(costs.co2(energy))} CO2 less"
    driven = yearly_money(shifts[0] - shifts[1], "EUR")  # no nights in it
    for page in (report_html(analysis, (), costs=costs), fleet_html([member], costs=costs)):
        answer = plain(page).split('<section id="answer">')[1]
        assert f"<b>{driven} of {both} a year reached</b>" in answer
        assert headline in answer
    assert "from the data sheet, not measured" in answers[0]
    picture = plain(report_html(analysis, (), costs=costs)).split('<section id="year">')[1]
    for value in (today, then):
        assert f"<b>{yearly_money(value, 'EUR')}</b>" in picture.partition("</section>")[0]
    assert idle_saving({}, None, costs) is None
