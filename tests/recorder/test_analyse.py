"""An analysed recording against closed forms and against what the synthetic run put in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ir_recorder import Analysis, analyse, findings, read_recording
from ir_recorder.analysis.agreement import LEVEL, agreement, mean_of
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
        np.testing.assert_allclose(result.joint_energy, result.step.movement.report.joint_energy, atol=0.5)


def test_energy_is_base_axes_brake_resistor_and_capacitor(analysis: Analysis) -> None:
    capacity = 106.0  # J, data of the drive
    for result in analysis.movements:
        rest = result.energy - result.base_energy - result.joint_energy.sum() - result.dissipated_energy
        assert abs(rest) <= capacity + 1.0


def test_motion_and_torque_give_the_same_energy_as_the_meter(analysis: Analysis) -> None:
    for result in analysis.movements:
        assert result.indirect_energy == pytest.approx(result.energy, abs=116.0)  # the capacitor holds 106 J


def test_both_measurements_agree_where_the_robot_is_as_its_data_say(analysis: Analysis) -> None:
    both = agreement(analysis)
    assert len(both.movements) == 3
    assert both.difference.low <= both.difference.value <= both.difference.high
    assert abs(both.difference.value) < 0.02
    assert "over 3 movements the indirect measurement is" in both.sentence
    for row in both.movements:
        assert row.from_torques == pytest.approx(row.direct, abs=116.0)
        assert np.isnan(row.second_opinion) or row.second_opinion == pytest.approx(row.indirect, rel=1e-6)


def test_the_interval_of_a_mean_covers_as_often_as_it_says() -> None:
    rng = np.random.default_rng(7)
    intervals = [mean_of(rng.normal(0.1, 0.05, 8)) for _ in range(2000)]
    inside = np.mean([each.low <= 0.1 <= each.high for each in intervals])
    assert inside == pytest.approx(LEVEL, abs=0.02)  # three standard deviations of 2000 draws


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
    started, ended = recording.events[0], recording.events[1]
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
    started, ended = recording.events[0], recording.events[1]
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
