"""An analysed recording against closed forms and against what the synthetic run put in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from ir_recorder import Analysis, analyse, findings, read_recording
from ir_recorder.analysis.indirect import agreement
from ir_recorder.analysis.intervals import mean_of
from ir_recorder.analysis.steps import executed_steps

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


def test_steps_know_when_they_moved_and_what_they_took(analysis: Analysis) -> None:
    assert [result.step.label for result in analysis.steps] == [
        "home → table",
        "table → press",
        "pause at press (STAND_ON_MOTORS)",
        "pause at press (BUS_POWER_OFF)",
        "press → home",
    ]
    for result in analysis.movements:
        assert result.seconds == pytest.approx(1.5, abs=1e-6)
        assert result.energy == pytest.approx(result.step.movement.report.energy, rel=1e-6)
        np.testing.assert_allclose(
            result.joint_energy, result.step.movement.report.joint_energy, atol=0.5
        )


def test_energy_is_base_axes_brake_resistor_and_capacitor(analysis: Analysis) -> None:
    capacity = 106.0  # J, data of the drive
    for result in analysis.movements:
        rest = (
            result.energy
            - result.base_energy
            - result.joint_energy.sum()
            - result.dissipated_energy
        )
        assert abs(rest) <= capacity + 1.0


def test_motion_and_torque_give_the_same_energy_as_the_meter(analysis: Analysis) -> None:
    for result in analysis.movements:
        assert result.indirect_energy == pytest.approx(
            result.energy, abs=116.0
        )  # the capacitor holds 106 J


def test_both_measurements_agree_where_the_robot_is_as_its_data_say(analysis: Analysis) -> None:
    both = agreement(analysis)
    assert len(both.movements) == 3
    assert both.difference.low <= both.difference.value <= both.difference.high
    assert abs(both.difference.value) < 0.02
    assert "over 3 movements the indirect measurement is" in both.sentence
    for row in both.movements:
        assert row.from_torques == pytest.approx(row.direct, abs=116.0)
        assert np.isnan(row.second_opinion) or row.second_opinion == pytest.approx(
            row.indirect, rel=1e-6
        )


def test_the_difference_has_the_interval_that_means_of_studies_have(analysis: Analysis) -> None:
    """One of three movements is far off: Student's interval alone would end nearer on its side."""
    shares = (0.01, 0.011, 0.05)
    both = agreement(with_differences(analysis, shares))
    student = ttest_1samp(shares, 0.0).confidence_interval(0.90)
    assert both.difference == mean_of(np.array([row.difference for row in both.movements]))
    assert both.difference.low == pytest.approx(student.low)
    assert both.difference.high > student.high + 0.01
    assert both.spread == pytest.approx(np.std(shares, ddof=1))


def test_movements_that_differ_alike_have_no_interval(analysis: Analysis) -> None:
    both = agreement(with_differences(analysis, (0.02, 0.02, 0.02)))
    assert np.isnan(both.difference.low)
    assert (
        both.sentence == "the indirect measurement of each of 3 movements is +2.0 % off the meter"
    )


def with_differences(analysis: Analysis, shares: Sequence[float]) -> Analysis:
    """The analysis with movements whose indirect energy is so many shares above the direct one."""
    moved = {
        id(result): replace(result, indirect_energy=result.energy * (1.0 + share))
        for result, share in zip(analysis.movements, shares, strict=True)
    }
    return replace(
        analysis, steps=tuple(moved.get(id(result), result) for result in analysis.steps)
    )


def test_a_recording_without_power_or_cell_gives_what_is_left(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    bare = analyse(replace(recording, power=None, cell_yaml="", controller=None))
    assert len(bare.steps) == 5
    assert np.isnan(bare.energy)
    assert bare.movements[0].clearance is None
    assert any("no cell is attached" in problem for problem in bare.problems)
    broken = analyse(replace(recording, cell_yaml="format: ir_cell/1\nname: ["))
    assert any("attached cell can't be read" in problem for problem in broken.problems)
    empty = analyse(replace(recording, power=None, joints=None, events=(), loads=()))
    assert not any(check.ok for check in findings(empty))


def test_a_movement_that_no_state_shows_lasts_as_planned_however_late_its_events_are(
    analysis: Analysis,
) -> None:
    """And a longer one, of which no state is recorded, as its events say."""
    recording = analysis.recording
    started = recording.events[0]
    ended = recording.events[1]
    for planned, lasts in ((0.004, 0.004), (1.0, 2.0)):
        report = replace(started.movement.report, duration=planned)
        movement = replace(started.movement, trajectory_id="unseen", report=report)
        events = tuple(
            replace(event, movement=movement, time=time)
            for event, time in ((started, started.time), (ended, started.time + 2.0))
        )
        (step,) = executed_steps(replace(recording, events=events))
        assert step.end - step.start == pytest.approx(lasts)


@pytest.mark.parametrize("late", [0.0, 0.03])
def test_a_movement_that_no_state_shows_ends_when_the_next_one_begins(
    analysis: Analysis, late: float
) -> None:
    """However late its events are: the power of the next one is none of its own."""
    recording = analysis.recording
    (first, *_) = executed_steps(recording)
    started = recording.events[0]
    ended = recording.events[1]
    report = replace(started.movement.report, duration=0.004)
    movement = replace(started.movement, trajectory_id="unseen", report=report)
    own = [
        replace(event, movement=movement, program_id="before", time=first.start + late)
        for event in (started, ended)
    ]
    unseen, moved = executed_steps(replace(recording, events=(*own, *recording.events)))[:2]
    assert (moved.start, moved.end) == (first.start, first.end)
    assert unseen.end == pytest.approx(moved.start)
    assert unseen.seconds == pytest.approx(0.0 if late == 0.0 else 0.004, abs=0.004)
