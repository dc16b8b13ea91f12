"""Law: a quantity has one definition. The cycle, its year and its saving are the same on every page
and in every table, whatever a recording holds and costs are given.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ir_description import PowerParameters, data_sheet_of
from ir_description.robot import drawn_robots
from ir_recorder import Analysis, analyse, findings
from ir_recorder.analysis.loads import carried
from ir_recorder.analysis.predicted_power import (
    BRAKES,
    MOTORS,
    BrakeTimer,
    pause_joules,
    recorded_power_data,
    resting_watts,
)
from ir_recorder.analysis.production import demand_watts, levers, production_of, stretches
from ir_recorder.analysis.results import FullPause
from ir_recorder.report import report_html
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_figures import by_mode, robots_of
from ir_recorder.report.fleet_members import fleet_columns, member_of
from ir_recorder.report.money_text import money, yearly_money
from ir_recorder.report.number_text import kilowatt_hours, yearly_kilowatt_hours
from ir_recorder.report.prices import J_PER_KWH, Costs
from ir_recorder.report.side_by_side import comparison_html

PAUSES = ("", "600 s, 1800 s", "5 s, 7 s", "60 s")


@pytest.fixture(scope="module", params=PAUSES)
def found(request: pytest.FixtureRequest, analysis: Analysis) -> Analysis:
    """A recording whose pauses are as long as in production, shorter, longer, or do not match."""
    facts = (("unshortened_pauses", request.param),) if request.param else ()
    return analyse(replace(analysis.recording, facts=facts))


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(3))
def test_a_year_is_one_value_on_every_page(found: Analysis, seed: int) -> None:
    draw = np.random.default_rng(seed).uniform
    costs = Costs(
        price=draw(0.05, 2.0),
        shift_hours=draw(1.0, 8.0),
        days_per_year=draw(10.0, 366.0),
        parts_per_cycle=draw(0.5, 20.0),
    )
    price = costs.price
    checks = findings(found)
    cycle = production_of(found)
    member = member_of(found, "robot")
    assert cycle is not None
    assert member is not None
    year = cycle.energy * costs.cycles_per_year(cycle.seconds)
    shown = (kilowatt_hours(year), money(year / J_PER_KWH * price, "EUR"))
    (robot,) = robots_of([member], costs)
    assert robot.yearly.value == pytest.approx(year)
    pages = [report_html(found, checks, costs=costs), fleet_html([member], costs=costs)]
    for page in pages:
        assert all(figure in page for figure in shown)
    assert shown[1] in comparison_html([(found, checks), (found, checks)], costs=costs)
    if cycle.savings is not None:
        total = cycle.savings.total
        cycles = costs.cycles_per_year(max(total.seconds, cycle.seconds))
        saved = money(total.saved * cycles / J_PER_KWH * price, "EUR")
        assert saved in pages[0]
        reached = abs(total.common - cycle.energy) * cycles
        assert yearly_money(reached / J_PER_KWH * price, "EUR") in pages[1]


def test_modes_and_steps_are_parts_of_the_cycle(found: Analysis) -> None:
    cycle = production_of(found)
    member = member_of(found, "robot")
    assert cycle is not None
    assert member is not None
    assert sum(share.energy for share in cycle.modes.values()) == pytest.approx(cycle.energy)
    assert sum(share.seconds for share in cycle.modes.values()) == pytest.approx(cycle.seconds)
    assert sum(share.energy for share in cycle.steps.values()) <= 1.001 * cycle.energy
    assert all(lever.joules <= cycle.energy for lever in levers(found, most=20))
    costs = Costs()
    years = by_mode([member], costs)
    (robot,) = robots_of([member], costs)
    assert sum(sum(own.values()) for own in years.values()) == pytest.approx(robot.yearly.value)
    columns = fleet_columns([member])
    assert columns["energy_j"][0] == cycle.energy


def test_the_largest_quarter_of_an_hour_takes_no_less_than_the_mean(
    found: Analysis, tended: Callable[[Analysis], Analysis]
) -> None:
    """Once a part took 763 W on average and its largest quarter of an hour 724 W: that was of the
    whole run, in which the line was empty first.
    """
    for run in (found, tended(found)):
        cycle = production_of(run)
        assert cycle is not None
        rows = stretches(run)
        seconds, joules = (sum(column) for column in zip(*rows, strict=True))
        if run.tending is None:
            assert seconds == pytest.approx(cycle.seconds * cycle.cycles)
        mean = cycle.energy / cycle.seconds
        assert joules / seconds == pytest.approx(mean)
        most = max(energy / time for time, energy in rows)
        assert (1.0 - 1e-9) * mean <= demand_watts(run, cycle) <= (1.0 + 1e-9) * most


def test_full_pauses_save_within_the_interval_of_drawn_robots(found: Analysis) -> None:
    """What each drawn robot saves is computed for it alone, from its own data."""
    full = found.program.unshortened if found.program is not None else None
    if full is None or not full.added or found.cell is None:
        pytest.skip("no pause is shortened")
    cell = found.cell
    data, _ = recorded_power_data(found.recording, found.cell)
    parameters = data_sheet_of(cell.robot, data)
    timer = BrakeTimer.of(data)
    joints = found.recording.joints
    assert joints is not None

    def changed(mode: str) -> float:
        return data.mode(mode).time_to_pause + data.mode(mode).regular_time_to_operate

    def saved(own: PowerParameters, pause: FullPause) -> float:
        step = found.steps[pause.step].step
        length = found.steps[pause.step].seconds + pause.seconds
        loads = own.loads_with(carried(cell, step.movement.load))
        there = replace(cell, robot=own.robot_with(cell.robot))
        q = joints.position[np.searchsorted(joints.time, step.start)]
        powers = [
            resting_watts(mode, q, there, loads, own.power_with(data))
            for mode in (MOTORS, BRAKES, step.movement.power_mode)
        ]
        alone = timer.joules(powers[0], powers[1], length)
        mode = step.movement.power_mode
        if mode == MOTORS or length < changed(mode):
            return 0.0
        return alone - pause_joules(powers[2], powers[0], length, changed(mode))

    for pause in full.added:
        nominal = saved(parameters, pause)
        for row, added in list(zip(drawn_robots(parameters), pause.saved_added, strict=True))[:40]:
            own = saved(replace(parameters, mean=row), pause)
            assert nominal + added == pytest.approx(own, rel=0.01, abs=5.0)


def test_savings_are_of_the_cycle_that_is_counted(found: Analysis) -> None:
    """Over the same seconds as the cycle's pauses, with the saving inside of its interval."""
    cycle = production_of(found)
    assert cycle is not None
    if cycle.savings is None or found.savings is None:
        pytest.skip("the recording carries no savings")
    total = cycle.savings.total
    full = found.program.unshortened if found.program is not None else None
    added = sum(pause.planned_seconds for pause in full.added) if full is not None else 0.0
    assert total.seconds == pytest.approx(found.savings.total.seconds + added)
    if found.savings.total.saved_high > found.savings.total.saved_low:
        assert total.saved_low <= total.saved <= total.saved_high


@pytest.mark.parametrize(
    ("energy", "shown", "of_a_year"),
    [
        (0.0, "0 Wh", "0 kWh"),
        (20.0, "20 J", "0.00000556 kWh"),
        (328_480.0, "91.2 Wh", "0.0912 kWh"),
        (3.59e6, "997 Wh", "0.997 kWh"),
        (8.6e6, "2.39 kWh", "2.39 kWh"),
        (4.2948e9, "1 193 kWh", "1 193 kWh"),
        (math.nan, "–", "–"),
    ],
)
def test_energies_are_in_wh_below_a_kilowatt_hour_but_in_a_column_of_years(
    energy: float, shown: str, of_a_year: str
) -> None:
    assert (kilowatt_hours(energy), yearly_kilowatt_hours(energy)) == (shown, of_a_year)
