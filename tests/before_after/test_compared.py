"""Today's program against the planner's: the same stops, sums that agree, savings by common
draws.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ir_description import ProgramStep
from ir_krl import follow, parse
from ir_msgs_py.savings import BeforeAfter
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner, ProgramPlan, RequestError
from ir_planner.before_after import (
    Today,
    TodayMotion,
    before_after,
    before_after_common,
    today_of_krl,
)
from ir_planner.before_after.today_steps import asked_program
from ir_planner.krl import evaluate_krl, station_at, tool_in_flange


def test_all_programs_make_the_same_stops_and_pauses(compared: BeforeAfter) -> None:
    names = [
        "start to point_1",
        "pause at point_1",
        "point_1 to point_2",
        "pause at point_2",
        "point_2 to home",
    ]
    for side in (compared.today, *compared.sides):
        assert [hop.name for hop in side.hops][:5] == names
        assert [hop.seconds for hop in side.hops if hop.is_pause][:2] == pytest.approx([5.0, 40.0])
        assert side.certified
    ends = [
        np.array(
            [
                step.trajectory.positions[-1]
                for step in side.movements
                if step.trajectory is not None
            ]
        )[-1]
        for side in (compared.today, *compared.sides)
    ]
    assert np.ptp(ends, axis=0) == pytest.approx(np.zeros(6), abs=1e-6)


def test_cycle_times_are_those_that_were_asked_for(compared: BeforeAfter) -> None:
    same, free, line = compared.sides
    assert same.report.duration == pytest.approx(compared.today.report.duration, abs=1e-3)
    assert line.report.duration == pytest.approx(60.0, abs=1e-3)
    assert free.report.duration < 60.0


def test_energies_of_hops_and_of_the_power_are_those_of_the_programs(compared: BeforeAfter) -> None:
    for side in (compared.today, *compared.sides):
        assert sum(hop.energy for hop in side.hops) == pytest.approx(side.report.energy)
        step = side.report.duration / len(side.time)
        assert float(side.watts.sum()) * step == pytest.approx(side.report.energy, rel=1e-9)
        assert (side.high >= side.watts).all()
        assert side.high.max() == pytest.approx(side.report.peak_power, rel=1e-9)


def test_a_saving_is_known_better_than_the_energies_that_it_is_the_difference_of(
    compared: BeforeAfter,
) -> None:
    for side in compared.sides:
        saving = side.saving
        assert saving.saved_low <= saving.saved <= saving.saved_high
        apart = (compared.today.report.energy_high - compared.today.report.energy_low) + (
            side.report.energy_high - side.report.energy_low
        )
        assert saving.saved_high - saving.saved_low < 0.7 * apart
        assert saving.certain


def test_a_line_that_needs_more_time_lets_todays_program_wait_as_well(
    compared: BeforeAfter,
) -> None:
    """Today's robot waits on motors, by the controller's timer on brakes after 20 s."""
    line = compared.sides[2]
    today = compared.today.report
    watts = (line.saving.common - today.energy) / (60.0 - today.duration)
    assert 600.0 < watts < 800.0


def test_changes_are_the_largest_savings_and_the_least_work_comes_first(
    compared: BeforeAfter,
) -> None:
    works = [change.work for change in compared.changes]
    assert works == sorted(works)
    assert compared.changes[0].name == "pause at point_2"
    assert "stand on brakes" in compared.changes[0].words
    by_hop = {hop.name: hop.energy for hop in compared.today.hops}
    for change in compared.changes:
        assert change.saving.common == pytest.approx(by_hop[change.name])
    passed = next(change for change in compared.changes if change.name == "point_1 to point_2")
    assert "1 stop less" in passed.words


@pytest.mark.long
def test_the_common_program_saves_what_the_planner_says(
    planned: ProgramPlan, common: BeforeAfter
) -> None:
    """Two computations of one figure: the answer's savings, and the sides of the comparison."""
    total = planned.savings.total
    saving = common.sides[0].saving
    assert saving.common == pytest.approx(total.common)
    assert saving.saved == pytest.approx(total.saved)
    assert (saving.saved_low, saving.saved_high) == pytest.approx(
        (total.saved_low, total.saved_high)
    )


@pytest.mark.long
def test_the_planners_own_program_as_todays_saves_next_to_nothing(planner: Planner) -> None:
    """Law: what is optimal already can't be improved by much."""
    plan = planner.plan_program(stations=("p1", "home"), start=planner.cell.machine_home)
    moves = [step.trajectory for step in plan.movements if step.trajectory is not None]
    stretches = tuple(TodayMotion(one, one.positions[-1], one.duration) for one in moves)
    found = before_after(planner, Today("own", "trace", planner.cell.machine_home, stretches))
    assert found.today.report.energy == pytest.approx(plan.report.energy, rel=1e-6)
    assert abs(found.planned.saving.share) < 0.01


@pytest.mark.long
def test_a_motion_that_is_faster_than_the_limits_is_compared_with_the_free_program(
    planner: Planner,
) -> None:
    """A trace a little faster than the limits ended in "the shortest is ..." and no comparison."""
    home = planner.cell.machine_home
    found = planner.plan_regional(start=home, goal="p1", objective="time").trajectory
    assert found is not None
    fast = JointTrajectory.from_seconds(found.joint_names, 0.9 * found.times, found.positions)
    stretch = TodayMotion(fast, fast.positions[-1], fast.duration, label="0.00 s")
    compared = before_after(planner, Today("fast.csv", "trace", home, (stretch,), ()))
    same, free = compared.sides
    assert not same.found
    assert "the shortest is" in same.problem
    assert free.found
    assert compared.towards == free.name


def test_a_program_that_goes_nowhere_is_a_sentence(planner: Planner) -> None:
    home = planner.cell.machine_home
    nothing = Today("still", "trace", home, (TodayMotion(None, home, 5.0),))
    with pytest.raises(RequestError, match="still has no movement"):
        before_after(planner, nothing)


@pytest.mark.parametrize("body", ["", "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}", "WAIT SEC 3"])
def test_a_krl_program_without_a_movement_is_a_sentence(planner: Planner, body: str) -> None:
    """The first motion only says where a program begins."""
    cell = planner.cell
    text = f"DEF ONE( )\n{body}\nEND\n"
    program = follow([parse(text, "one.src")], cell.machine_home, tool_in_flange(cell.tcp))
    found = evaluate_krl(planner, program)
    assert not found.moves
    with pytest.raises(RequestError, match="ONE has no movement: there is nothing to compare"):
        today_of_krl(found)


def test_pauses_alone_are_nothing_to_compare(planner: Planner) -> None:
    cell = replace(planner.cell, program=(ProgramStep("PAUSE", dwell=9.0, power_mode="AUTO"),))
    with pytest.raises(RequestError, match="has no movement: there is nothing to compare"):
        before_after_common(Planner(cell), (), cell.machine_home)


def test_a_cells_program_that_begins_in_a_posture_is_todays_that_starts_there(
    planner: Planner, planned: ProgramPlan
) -> None:
    """The first PTP HOME only leads onto the path, so that no step of today's matched it."""
    moves = [step.trajectory for step in planned.movements if step.trajectory is not None]
    scene = planner.scene("")
    ends = [one.positions[-1] for one in moves]
    stretches = tuple(
        TodayMotion(one, end, one.duration, works=bool(station_at(scene, end)))
        for one, end in zip(moves, ends, strict=True)
    )
    today = Today("own", "trace", planner.cell.machine_home, stretches)
    stops = (ProgramStep("STATION", "p1"), ProgramStep("POSTURE", "home"))
    for program in (stops, (ProgramStep("POSTURE", "home"), *stops)):
        asked = asked_program(today, replace(scene, cell=replace(scene.cell, program=program)))
        assert "parts and signals at the stops are those of the cell's own program" in asked.notes
    elsewhere = replace(today, start=today.start + 0.1)  # as a log that begins anywhere
    asked = asked_program(elsewhere, replace(scene, cell=replace(scene.cell, program=program)))
    assert "parts and signals at the stops are those of the cell's own program" not in asked.notes
