"""Law: what a page shows is of one program, or says of which: steps, motion and money of a plan,
what was driven and what was computed, what nobody drove, and how far a run is from its plan.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ir_msgs_py.savings import ProgramSavings, Saving
from ir_recorder import Analysis, analyse, findings
from ir_recorder.analysis.production import SLOWER, demand_watts, production_of
from ir_recorder.reading.recording import SavingsEvent
from ir_recorder.report import report_html
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_members import fleet_columns, member_of
from ir_recorder.report.money_text import yearly_money
from ir_recorder.report.nights import recorded_idle_saving
from ir_recorder.report.number_text import joules, kilowatt_hours, percent, seconds
from ir_recorder.report.prices import Costs
from ir_recorder.report.side_by_side import comparison_html

SHORTENED = (("unshortened_pauses", "600 s, 1800 s"),)
SHEET = "from the data sheet, not measured"


def plain(page: str) -> str:
    """The page without the elements of its amounts of money."""
    return re.sub(r"</?data[^>]*>", "", page)


def plan_of(analysis: Analysis, slower: float, cheaper: float) -> Analysis:
    """The steps of a run as a plan that nobody drove, held against a common program that takes so
    much longer [s], in whose time the plan takes so much less [J].
    """
    planned = tuple(
        replace(result.step.movement, duration=result.seconds) for result in analysis.steps
    )
    energy = sum(step.report.energy for step in planned)
    whole = sum(step.duration for step in planned) + slower
    saving = Saving(1.5 * energy, energy - cheaper, whole, 0.3 * energy, 0.6 * energy)
    event = SavingsEvent(0.0, ProgramSavings(available=True, movements=saving))
    recording = replace(
        analysis.recording,
        planned=planned,
        savings=(event,),
        events=(),
        facts=(("plan", "never driven"),),
    )
    return analyse(recording)


@pytest.fixture(scope="module")
def shortened(analysis: Analysis) -> Analysis:
    return analyse(replace(analysis.recording, facts=SHORTENED))


@pytest.mark.parametrize("seed", range(3))
def test_money_of_a_plan_and_its_steps_are_of_one_program_or_their_difference_is_a_row(
    analysis: Analysis, seed: int
) -> None:
    """Its yearly money was of a program stretched to the common one's time, its steps and film of
    one that took less, and no page said so.
    """
    draw = np.random.default_rng(seed).uniform
    slower = draw(0.5, 4.0)
    cheaper = draw(-500.0, 500.0)
    plan = plan_of(analysis, slower, cheaper)
    cycle = production_of(plan)
    steps = plan.recording.planned
    assert cycle is not None
    own = sum(step.report.energy for step in steps), sum(step.duration for step in steps)
    assert (cycle.energy, cycle.seconds) == pytest.approx((own[0] - cheaper, own[1] + slower))
    page = report_html(plan, findings(plan))
    table = page.split('id="steps"')[1].partition("</table>")[0]
    rows = (
        (SLOWER, -cheaper, slower),
        ("cycle that the money is of", cycle.energy, cycle.seconds),
    )
    for name, energy, time in rows:
        row = table.partition(f"<b>{name.replace(chr(39), '&#x27;')}</b>")[2].partition("</tr>")[0]
        assert f"<b>{joules(energy)}</b>" in row
        assert seconds(time) in row
    word = "less" if cheaper < 0.0 else "more"
    said = f"{seconds(slower)} sooner and {kilowatt_hours(abs(cheaper))} {word} a cycle"
    for place in ("motion", "costs"):
        assert said in page.split(f'id="{place}"')[1].partition("</section>")[0]
    other = replace(analysis, recording=replace(analysis.recording, path=Path("other.mcap")))
    assert said in comparison_html([(plan, ()), (other, ())])


def test_a_plan_in_its_own_time_says_nothing_of_another(analysis: Analysis) -> None:
    alone = analyse(replace(plan_of(analysis, 1.0, 100.0).recording, savings=()))
    cycle = production_of(alone)
    assert cycle is not None
    assert cycle.own is None
    assert "as fast as pays" not in report_html(alone, ())


@pytest.mark.parametrize("kind", ["driven", "shortened", "tended", "planned"])
def test_steps_and_modes_add_up_to_the_cycle(
    analysis: Analysis, shortened: Analysis, tended: Callable[[Analysis], Analysis], kind: str
) -> None:
    """Waiting between steps, and what a plan takes in another program's time, are in no step."""
    found = {
        "driven": analysis,
        "shortened": shortened,
        "tended": tended(analysis),
        "planned": plan_of(analysis, 2.0, 300.0),
    }[kind]
    cycle = production_of(found)
    assert cycle is not None
    for shares in (cycle.modes, cycle.steps):
        assert sum(share.energy for share in shares.values()) == pytest.approx(cycle.energy)
        assert sum(share.seconds for share in shares.values()) == pytest.approx(cycle.seconds)
    assert demand_watts(found, cycle) >= (1.0 - 1e-9) * cycle.energy / cycle.seconds


def test_what_nobody_drove_of_a_cycle_is_said_beside_every_figure_of_it(
    analysis: Analysis, shortened: Analysis
) -> None:
    """Of a run with shortened pauses most joules of a year were those of the data sheet, under the
    words "as driven, simulated".
    """
    cycle = production_of(shortened)
    assert cycle is not None
    assert cycle.computed is not None
    assert shortened.program is not None
    measured = shortened.program.whole.energy
    assert cycle.computed.energy == pytest.approx(cycle.energy - measured)
    part = 100.0 * (1.0 - measured / cycle.energy)
    said = rf"{part:.3g}\d* % of it computed: pauses at full length, {SHEET}"
    member = member_of(shortened, "robot")
    assert member is not None
    other = replace(analysis, recording=replace(analysis.recording, path=Path("other.mcap")))
    checks = findings(shortened)
    report = plain(report_html(shortened, checks))
    fleet = plain(fleet_html([member]))
    pages = (report, fleet, plain(comparison_html([(shortened, checks), (other, checks)])))
    assert all(re.search(said, page) for page in pages)
    for name in ("costs a year in shifts, as driven", "largest quarter of an hour"):
        tile = report.split(f"<span>{name}</span>")[1].partition("</div>")[0]
        assert re.search(said, tile)
    assert f"as driven, {shortened.recording.origin}, full pauses computed" in report
    assert "Pauses that runs shortened count at full length: computed" in fleet
    columns = fleet_columns([member])
    row = columns["what"].index("computed")
    assert columns["energy_j"][row] == cycle.computed.energy
    assert "computed: pauses" not in plain(report_html(analysis, checks))


def test_how_far_a_run_is_from_its_plan_is_one_figure(
    analysis: Analysis, shortened: Analysis
) -> None:
    """One page said 6.2 % of the run and 0.7 % of a cycle with computed pauses, which it held
    against another program.
    """
    for found in (analysis, shortened):
        assert found.program is not None
        planned = sum(result.step.movement.report.energy for result in found.steps)
        exact = percent(found.program.whole.energy / planned - 1.0)
        member = member_of(found, "robot")
        assert member is not None
        page = plain(report_html(found, findings(found)))
        answer = page.split('id="answer"')[1].partition("</section>")[0]
        run = page.split("<h2>This run in figures</h2>")[1].partition("</div>")[0]
        months = plain(fleet_html([member])).split('id="months"')[1].partition("</section>")[0]
        assert f"{exact} against the {kilowatt_hours(planned)} predicted of it" in answer
        assert f"{found.recording.origin} {exact}" in run
        assert f"<b>{exact}</b>" in months
        assert "as planned" not in answer


def test_what_was_reached_is_what_the_plan_saves_but_for_what_is_named(analysis: Analysis) -> None:
    """The list of what was reached added up to 106 EUR, the picture said 105 EUR."""
    page = plain(report_html(analysis, (), costs=Costs(price=20.0)))
    answer, _, picture = page.partition('<section id="year">')
    listed = answer.split("Reached: keep driving it")[1].partition("Still to save")[0]
    steps = re.findall(r": (-?[\d., ]+) EUR", listed)
    off, side = re.findall(r"Driven ([\d. ]+) EUR a year (above|below) the plan", answer)[0]
    common, driven = (
        float(
            re.findall(rf">{name}[^<]*</span>.*?<b>([\d ]+) EUR</b>", picture)[0].replace(" ", "")
        )
        for name in ("common program", "as driven")
    )
    planned = sum(float(each.replace(" ", "")) for each in steps)
    named = float(off.replace(" ", "")) * (-1.0 if side == "above" else 1.0)
    assert common - driven == pytest.approx(planned + named, abs=2.5)  # each is rounded by itself


def test_what_a_robot_takes_until_its_next_cycle_is_named(analysis: Analysis) -> None:
    """A year counts the cycles of the common program, and nothing of the wait for the next one."""
    found = analysis.savings
    cycle = production_of(analysis)
    assert found is not None
    assert cycle is not None
    longer = replace(found.movements, seconds=cycle.seconds + 2.0 - found.pauses.seconds)
    event = replace(analysis.recording.savings[0], savings=replace(found, movements=longer))
    late = analyse(replace(analysis.recording, savings=(event,)))
    page = plain(report_html(late, ()))
    (watts,) = re.findall(r"<td[^>]*>stand on motors</td><td[^>]*>([\d ]+) W</td>", page)
    words = re.findall(r"ends 2\.00 s sooner, .* not counted \(at most ([\d.]+) Wh a cycle\)", page)
    assert float(words[0]) == pytest.approx(2.0 * float(watts) / 3600.0, rel=0.01)
    assert "is not counted (" not in plain(report_html(plan_of(analysis, 2.0, 300.0), ()))


def test_nights_are_named_beside_each_year(analysis: Analysis) -> None:
    """A year as driven and the planned one were 452 and 235 EUR: nights on brakes in one, in
    hibernation in the other.
    """
    costs = Costs()
    idle = recorded_idle_saving(analysis, costs)
    assert idle is not None
    page = plain(report_html(analysis, (), costs=costs))
    year = page.split('id="year"')[1].partition("</section>")[0]
    cycle = production_of(analysis)
    assert cycle is not None
    assert cycle.savings is not None
    count = costs.cycles_per_year(cycle.pace)
    total = cycle.savings.total
    rows = (
        (total.common * count, idle.left_alone),
        (cycle.energy * count, idle.left_alone),
        (total.planned * count, idle.deepest),
    )
    noted = re.findall(r"<small>([^<]*) outside</small>", year)
    assert noted == [
        " in shifts, ".join(yearly_money(each, "EUR") for each in (costs.money(energy), nights))
        for energy, nights in rows
    ]
    assert year.count("nights on closed brakes</span>") == 2
    assert "planned program, nights in hibernation</span>" in year


def test_bars_of_recordings_are_the_years_of_the_table_below(analysis: Analysis) -> None:
    """A plan was 452 EUR there, with nights on brakes, and 235 EUR on its own page, with nights in
    hibernation; the table below had 132 EUR, without nights.
    """
    cycle = production_of(analysis)
    assert cycle is not None
    costs = Costs()
    price = yearly_money(costs.energy_of_year(cycle).of(costs.money).value, "EUR")
    page = plain(comparison_html([(analysis, ()), (analysis, ())], costs))
    bars = page.split('class="bars"')[1].partition("</section>")[0].partition("<table")[0]
    assert re.findall(r'class="value"><b>([^<]*)</b>', bars) == [price, price]
    row = page.split("a year of such cycles</td>")[1].partition("</tr>")[0]
    assert re.findall(r"<b>([^<]*)</b>", row) == [price, price]


def test_a_plan_that_nobody_drove_is_among_what_could_still_be_saved(
    analysis: Analysis, shortened: Analysis
) -> None:
    """It was in the sum of a robot and of all, and in no row of the measures."""
    costs = Costs()
    driven = member_of(shortened, "driven")
    plan = member_of(plan_of(analysis, 2.0, 300.0), "undriven")
    assert driven is not None
    assert plan is not None
    saved = costs.saving_of_year(plan.cycle)
    assert saved is not None
    price = yearly_money(costs.money(saved.value), "EUR")
    page = plain(fleet_html([driven, plan], costs=costs))
    measures = page.split('id="first"')[1].partition("</section>")[0]
    row = measures.split("plans that nobody drove")[1].partition("</tr>")[0]
    assert f"<b>{price}</b>" in row
    robots = page.split('id="robots"')[1].partition("</section>")[0]
    assert f"{price} by its plan" in robots
    assert "plans that nobody drove" not in plain(fleet_html([driven], costs=costs))


def test_an_amount_of_a_year_is_rounded_from_one_value_everywhere(analysis: Analysis) -> None:
    """Bars showed the difference of rounded amounts, headlines and tables the rounded difference:
    one robot had 218 and 217 EUR still to save.
    """
    plan = plan_of(analysis, 2.0, 300.0)
    member = member_of(plan, "robot")
    cycle = production_of(plan)
    assert member is not None
    assert cycle is not None
    draw = np.random.default_rng(0).uniform
    for _ in range(8):
        costs = Costs(price=draw(0.05, 2.0))
        saved = costs.saving_of_year(cycle)
        common = costs.common_of_year(cycle)
        idle = recorded_idle_saving(plan, costs)
        assert saved is not None
        assert common is not None
        assert idle is not None
        amounts = (
            costs.money(saved.value) + idle.saved,
            costs.money(common) + idle.left_alone,
            costs.money(common - saved.value) + idle.deepest,
        )
        for page in (report_html(plan, (), costs=costs), fleet_html([member], costs=costs)):
            year = plain(page).split('id="year"')[1].partition("</section>")[0]
            assert all(f"<b>{yearly_money(each, 'EUR')}</b>" in year for each in amounts)
            answer = plain(page).split('id="answer"')[1].partition("</section>")[0]
            assert f"<b>{yearly_money(amounts[0], 'EUR')} " in answer
