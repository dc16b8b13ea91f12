"""Checks hold for a run as planned, and fail where it departs from the plan."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_msgs.msg import PlannedMovement
from ir_msgs_py.modes import Mode
from ir_recorder import (
    Analysis,
    Finding,
    Tolerances,
    Verdict,
    analyse,
    findings,
    read_recording,
    summary,
)
from ir_recorder.analysis.results import StepResult
from ir_recorder.reading.recording import GoalEnd, Recording

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
NEAR = Tolerances(
    resting_rows=8, safety_distance=-1.0
)  # the synthetic run passes through its machines


def named(checks: tuple[Finding, ...], start: str) -> list[Finding]:
    return [check for check in checks if check.name.startswith(start)]


def test_checks_hold_for_a_run_as_planned(analysis: Analysis) -> None:
    checks = findings(analysis, NEAR)
    assert [check.name for check in checks if not check.ok] == []
    assert len(checks) > 30
    assert summary(checks)[0] is Verdict.HOLDS


def test_a_recording_says_itself_how_many_modes_it_has_to_show(analysis: Analysis) -> None:
    """What `ir demo` checks, `ir report` of its recording checks as well."""
    shown = len(analysis.plateaus)
    assert shown > 0

    def checked(fact: str) -> list[Verdict]:
        recording = replace(analysis.recording, facts=(("modes_at_rest", fact),))
        found = findings(replace(analysis, recording=recording))
        return [check.verdict for check in named(found, "modes shown")]

    assert checked(str(shown)) == [Verdict.HOLDS]
    assert checked(str(shown + 1)) == [Verdict.FAILS]
    assert [checked(fact) for fact in ("", "0", "many", "9" * 5000)] == [[], [], [], []]


def test_every_check_gives_the_reason_of_its_bound(analysis: Analysis) -> None:
    for check in findings(analysis):
        assert check.reason or check.verdict is Verdict.NOT_CHECKED


def test_a_run_whose_planning_failed_is_not_green(analysis: Analysis) -> None:
    """Power and joint states alone: the grid holds, but nothing of a program was shown."""
    alone = replace(analysis.recording, events=(), loads=(), goals=())
    checks = findings(analyse(alone))
    (program,) = named(checks, "program executed")
    assert program.verdict is Verdict.NOT_CHECKED
    assert any(check.ok for check in checks)
    assert summary(checks)[0] is Verdict.NOT_CHECKED
    refused = replace(alone, goals=(GoalEnd("ir_planner/plan", 6, "aborted"),))
    (goals,) = named(findings(analyse(refused)), "goals of ir_planner/plan")
    assert (goals.verdict, goals.note) == (Verdict.FAILS, "aborted")


def test_a_program_that_stopped_early_fails(analysis: Analysis) -> None:
    shorter = replace(analysis, steps=analysis.steps[:3])
    (check,) = named(findings(shorter), "steps of the program")
    assert (check.measured, check.low, check.verdict) == (3, 5, Verdict.FAILS)


def test_a_step_without_an_end_is_named(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    cut = replace(recording, events=recording.events[:-1])
    (check,) = named(findings(analyse(cut)), "steps of the program")
    assert check.verdict is Verdict.FAILS
    assert check.note == "5 press → home: open"


@pytest.mark.parametrize(("planned", "beyond"), [(500.0, 20.0), (5000.0, 75.0)])
def test_a_movement_may_differ_by_one_percent_or_ten_joules(
    analysis: Analysis, planned: float, beyond: float
) -> None:
    moved = analysis.movements[0]
    report = replace(moved.step.movement.report, energy=planned)
    step = replace(moved.step, movement=replace(moved.step.movement, report=report))
    for off, ok in ((0.45 * beyond, True), (beyond, False)):
        for sign in (-1.0, 1.0):
            result = replace(moved, step=step, energy=planned + sign * off, stored_energy=0.0)
            (check,) = named(
                findings(replace(analysis, steps=(result,))), "energy of 1 home → table"
            )[:1]
            assert check.ok == ok, check


@pytest.mark.parametrize(("held", "ok"), [(0.0, False), (float("nan"), False), (35.0, True)])
def test_what_the_next_movement_drew_in_a_shared_reading_is_no_fault_of_a_step(
    analysis: Analysis, held: float, ok: bool
) -> None:
    """A first step that stands still for 4 ms shares its reading with the next one's
    acceleration.
    """
    moved = analysis.movements[0]
    report = replace(moved.step.movement.report, energy=3.0, duration=0.004)
    step = replace(moved.step, movement=replace(moved.step.movement, report=report))
    result = replace(moved, step=step, energy=33.0, straddling_energy=held, stored_energy=0.0)
    (check,) = named(findings(replace(analysis, steps=(result,))), "energy of 1 home → table")[:1]
    assert check.ok == ok
    assert f"1 % or {held if ok else 10:g} J" in check.reason


def test_what_the_capacitors_held_may_be_missing_but_not_more(analysis: Analysis) -> None:
    moved = analysis.movements[0]
    planned = moved.step.movement.report.energy
    for short, ok in ((50.0, True), (50.0 + 0.02 * planned + 10.0, False)):
        result = replace(moved, energy=planned - short, stored_energy=50.0)
        check = named(findings(replace(analysis, steps=(result,))), "energy of")[0]
        assert check.ok == ok
        assert "50 J that the capacitors held" in check.reason


def test_pauses_are_checked_too(analysis: Analysis) -> None:
    names = [check.name for check in findings(analysis) if "pause" in check.name]
    assert len(names) == 4  # energy and duration of both
    rested = analysis.steps[3]
    for more, ok in ((0.4, True), (0.7, False)):
        result = replace(rested, energy=rested.energy + more * rested.motors_power)
        check = named(findings(replace(analysis, steps=(result,))), "energy of")[0]
        assert check.ok == ok


def test_a_pause_may_last_longer_by_what_a_busy_computer_delayed_the_plant(
    analysis: Analysis,
) -> None:
    pause = next(s for s in analysis.steps if s.step.movement.is_pause)
    end = pause.step.start + pause.step.movement.duration + 0.6
    late = replace(pause, step=replace(pause.step, end=end))
    for slip, holds in ((0.0, False), (0.05, False), (0.2, True)):
        steps = (replace(late, slip=slip),)
        (check,) = named(findings(replace(analysis, steps=steps)), "duration of")
        assert check.ok == holds
        assert ("busy computer" in check.reason) == (slip > 0.1)


def test_a_plant_that_is_not_the_model_is_held_against_the_interval_of_a_pause(
    analysis: Analysis,
) -> None:
    """What drives draw while they stand is known by its interval alone, as in movements."""
    pause = next(s for s in analysis.steps if s.step.movement.is_pause)
    planned = pause.step.movement.report.energy
    report = replace(
        pause.step.movement.report, energy_low=0.9 * planned, energy_high=1.5 * planned
    )
    movement = replace(
        pause.step.movement, report=report, duration=pause.seconds, power_mode="STAND_ON_MOTORS"
    )
    step = replace(pause.step, movement=movement)
    for share, ok in ((1.75, True), (1.85, False), (0.65, True), (0.55, False)):
        result = replace(pause, step=step, energy=share * planned, stored_energy=0.0)
        own = Tolerances(within_interval=True, energy_absolute=1.0)
        check = named(findings(replace(analysis, steps=(result,)), own), "energy of")[0]
        assert check.ok == ok, check


def test_power_at_rest_is_held_against_the_interval_of_what_drives_draw(analysis: Analysis) -> None:
    row = next(row for row in analysis.plateaus if row.mode == "STAND_ON_MOTORS")
    assert row.low <= row.expected <= row.high
    wide = replace(row, low=row.expected - 10.0, high=row.expected + 400.0)
    own = Tolerances(within_interval=True)
    for watts, ok in ((600.0, True), (610.0, False), (-220.0, False)):
        seen = replace(wide, power=row.expected + watts)
        (check,) = named(findings(replace(analysis, plateaus=(seen,)), own), "power at rest")
        assert check.ok == ok, check


def test_a_movement_that_took_more_than_planned_fails_its_check(
    new_run: Callable[[], Any], tmp_path: Path
) -> None:
    run = new_run()
    goal = HOME + np.radians([60.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    run.rest(0.1, Mode.STAND_ON_MOTORS, HOME, "gripper")
    run.move(1.0, HOME, goal, "gripper", PlannedMovement(kind="regional", to_station="table"))
    checks = findings(analyse(read_recording(run.record(tmp_path / "a.mcap", plan_factor=0.5))))
    energy = named(checks, "energy of")[0]
    assert energy.verdict is Verdict.FAILS
    assert energy.measured == pytest.approx(2.0 * energy.expected, rel=1e-6)


def test_a_movement_without_a_meter_is_not_checked(demo_file: Path) -> None:
    checks = findings(analyse(replace(read_recording(demo_file), power=None)))
    assert {check.verdict for check in named(checks, "energy of")} == {Verdict.NOT_CHECKED}
    assert summary(checks)[0] is not Verdict.HOLDS


def test_an_empty_recording_is_not_checked(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    checks = findings(
        analyse(replace(recording, power=None, joints=None, events=(), loads=(), goals=()))
    )
    assert summary(checks) == (Verdict.NOT_CHECKED, "nothing was checked")


def test_a_tool_of_ones_own_is_not_held_against_table_2(
    new_run: Callable[[], Any], tmp_path: Path
) -> None:
    run = new_run()
    run.rest(1.0, Mode.STAND_ON_MOTORS, HOME, "gripper+part")
    checks = findings(analyse(read_recording(run.record(tmp_path / "own.mcap"))))
    (own,) = named(checks, "power at rest")
    assert own.ok
    assert named(checks, "Table II") == []


@pytest.mark.parametrize("deviation", [0.0, 0.002, 0.1, math.nan])
def test_clearance_may_only_lack_what_the_tool_was_off(
    analysis: Analysis, deviation: float
) -> None:
    moved = analysis.movements[1]
    assert moved.clearance is not None
    tolerated = 0.005 if math.isnan(deviation) else min(deviation, 0.005)
    for beyond, ok in ((-2e-5, True), (2e-5, False)):
        short = tolerated + 1e-4 + beyond
        near = replace(moved.clearance, least=0.02 - short, contact_margin=-short)
        result = replace(moved, tool_deviation=deviation, clearance=near)
        checks = findings(replace(analysis, steps=(result,)))
        for name in ("clearance on", "allowed contacts on"):
            (check,) = named(checks, name)
            assert check.ok == ok


@pytest.mark.parametrize(
    ("recorded", "certified", "planned", "kept", "source"),
    [
        (math.nan, True, 0.006, 0.006, "clearance of the certified plan 6.0 mm"),
        (math.nan, False, 0.006, 0.02, "default safety distance (none is recorded) 20.0 mm"),
        (math.nan, True, 0.05, 0.02, "default safety distance (none is recorded) 20.0 mm"),
        (math.nan, True, math.inf, 0.02, "default safety distance (none is recorded) 20.0 mm"),
        (0.035, True, 0.006, 0.035, "safety distance of the recording 35.0 mm"),
        (0.001, False, 0.5, 0.001, "safety distance of the recording 1.0 mm"),
    ],
)
def test_clearance_is_held_against_the_safety_distance_it_was_planned_with(
    analysis: Analysis, recorded: float, certified: bool, planned: float, kept: float, source: str
) -> None:
    moved = analysis.movements[1]
    assert moved.clearance is not None
    report = replace(moved.step.movement.report, certified=certified, min_clearance=planned)
    step = replace(moved.step, movement=replace(moved.step.movement, report=report))
    for beyond, ok in ((-2e-5, True), (2e-5, False)):
        near = replace(moved.clearance, least=kept - 1e-4 - beyond)
        result = replace(moved, step=step, tool_deviation=0.0, clearance=near)
        (check,) = named(
            findings(replace(analysis, steps=(result,), safety_distance=recorded)), "clearance on"
        )
        assert check.ok == ok
        assert check.reason.startswith(source)


def test_the_safety_distance_of_the_plan_comes_before_that_of_the_recording(
    analysis: Analysis,
) -> None:
    moved = analysis.movements[1]
    report = replace(
        moved.step.movement.report, certified=True, min_clearance=0.006, safety_distance=0.005
    )
    step = replace(moved.step, movement=replace(moved.step.movement, report=report))
    near = replace(moved.clearance, least=0.0051)
    result = replace(moved, step=step, tool_deviation=0.0, clearance=near)
    (check,) = named(
        findings(replace(analysis, steps=(result,), safety_distance=0.02)), "clearance on"
    )
    assert check.ok
    assert check.reason.startswith("safety distance of the plan 5.0 mm")


def test_a_plant_that_is_not_the_model_is_held_against_twice_the_interval(
    analysis: Analysis,
) -> None:
    """One joule more than the interval's end is no fault; as much beyond it again is one."""
    recording = analysis.recording
    assert recording.power is not None
    other = replace(recording, power=replace(recording.power, plant="typical, seed 7"))
    result = analysis.steps[0]
    report = result.step.movement.report
    low = 0.9 * report.energy
    high = 1.1 * report.energy
    movement = replace(
        result.step.movement, report=replace(report, energy_low=low, energy_high=high)
    )

    def check(energy: float, run: Recording) -> Finding:
        step = replace(result, step=replace(result.step, movement=movement), energy=energy)
        (found,) = named(
            findings(replace(analysis, recording=run, steps=(step,))),
            f"energy of {step_name(step)}",
        )[:1]
        return found

    assert check(high + 1.0, other).verdict is Verdict.HOLDS
    assert "the plant is not the model" in check(high, other).reason
    assert check(2.0 * high - report.energy + 11.0, other).verdict is Verdict.FAILS
    assert check(high + 1.0, recording).verdict is Verdict.FAILS


def test_an_interval_that_begins_with_what_is_predicted_is_doubled_about_its_middle(
    analysis: Analysis,
) -> None:
    """What the data put at zero makes nearly all robots dearer than predicted, not all of them."""
    result = next(each for each in analysis.steps if not each.step.movement.is_pause)
    planned = result.step.movement.report.energy
    report = replace(result.step.movement.report, energy_low=planned, energy_high=1.4 * planned)
    step = replace(result.step, movement=replace(result.step.movement, report=report))
    own = Tolerances(within_interval=True, energy_absolute=1e-3 * planned)
    for share, ok in ((0.97, True), (0.82, True), (0.78, False), (1.58, True), (1.62, False)):
        seen = replace(result, step=step, energy=share * planned, stored_energy=0.0)
        seen = replace(seen, straddling_energy=0.0)
        check = named(findings(replace(analysis, steps=(seen,)), own), "energy of")[0]
        assert check.ok == ok, check


def step_name(result: StepResult) -> str:
    return f"{result.step.index + 1} {result.step.label}"


def test_a_movement_of_a_few_milliseconds_is_not_measured_by_what_it_has_no_samples_of(
    analysis: Analysis,
) -> None:
    """Positions, or a state of the controller; its energy by the meter is checked as ever."""
    result = analysis.steps[0]
    report = replace(result.step.movement.report, duration=0.004)
    step = replace(result.step, movement=replace(result.step.movement, report=report))
    unseen = replace(result, step=step, indirect_energy=math.nan, tool_deviation=math.nan)
    short = replace(analysis, steps=(unseen,))
    assert named(findings(short), "tool deviation") == []
    assert [check.name for check in named(findings(short), "energy of")] == [
        f"energy of {step_name(result)}"
    ]
    lost = replace(analysis, steps=(replace(result, indirect_energy=math.nan),))
    verdicts = [check.verdict for check in named(findings(lost), "energy of")]
    assert Verdict.NOT_CHECKED in verdicts
