"""Numbers of the analysis against closed forms and against what the synthetic run put in."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ir_msgs.msg import PlannedMovement
from ir_msgs_py.power import Mode
from ir_recorder.analysis.clearance import collision_model
from ir_recorder.analysis.grid import check_grid
from ir_recorder.analysis.loads import LoadTimeline, after, load_timeline
from ir_recorder.analysis.meter import Meter
from ir_recorder.read.recording import TextEvent

from ir_recorder import Analysis, Tolerances, analyse, findings, read_recording

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def analysis(demo_file: Path) -> Analysis:
    return analyse(read_recording(demo_file))


def test_all_eight_values_of_table_2_come_out_of_the_recording_alone(analysis: Analysis) -> None:
    assert len(analysis.plateaus) == 8
    for row in analysis.plateaus:
        assert row.power == pytest.approx(row.expected, rel=1e-3)


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


def test_energy_is_base_and_axes_and_burnt_and_what_the_capacitor_took(analysis: Analysis) -> None:
    capacity = 106.0  # J, data of the drive
    for result in analysis.movements:
        rest = result.energy - result.base_energy - result.joint_energy.sum() - result.dissipated_energy
        assert abs(rest) <= capacity + 1.0


def test_motion_and_torque_tell_the_same_energy_as_the_meter(analysis: Analysis) -> None:
    for result in analysis.movements:
        assert result.indirect_energy == pytest.approx(result.energy, abs=110.0)  # the capacitor's charge


def test_modes_and_steps_share_all_time_and_energy(analysis: Analysis) -> None:
    assert sum(share.energy for share in analysis.modes) == pytest.approx(analysis.energy)
    assert sum(share.seconds for share in analysis.modes) == pytest.approx(analysis.seconds)
    total = sum(use.energy for use in analysis.stations) + analysis.elsewhere.energy
    assert total == pytest.approx(analysis.energy)


def test_stations_get_their_pauses_service_movements_and_ways(analysis: Analysis) -> None:
    uses = {use.station: use for use in analysis.stations}
    assert set(uses) == {"table", "press"}
    assert uses["table"].travel.seconds == pytest.approx(1.5, abs=1e-6)
    assert uses["press"].service.seconds == pytest.approx(3.0, abs=1e-6)
    assert uses["press"].rest.seconds == pytest.approx(1.2, abs=1e-6)


def test_clearance_is_that_of_the_recorded_joint_states(analysis: Analysis) -> None:
    result = analysis.movements[1]
    near, joints = result.clearance, analysis.recording.joints
    model = collision_model(analysis.cell, "gripper+part", analysis.cell.parts_at_start())
    inside = (joints.time >= result.step.start) & (joints.time <= result.step.end)
    distances = model.distances(joints.position[inside])
    allowed = [{"p_body", "press_bed"} == {pair.body_a, pair.body_b} for pair in model.pairs]
    assert near.least == pytest.approx(distances[:, ~np.array(allowed)].min(), abs=1e-6)
    assert near.contact_margin >= distances[:, allowed].min() - 0.001 - 1e-9
    assert near.least <= near.distance.min()


def test_a_part_that_was_put_down_is_a_body_where_it_lies(analysis: Analysis) -> None:
    leaving = analysis.movements[2].clearance
    assert any("part_box" in pair for pair in leaving.pairs)


@pytest.mark.parametrize("deviation", [0.0, 0.002, 0.1, math.nan])
def test_clearance_may_only_lack_what_the_tool_was_off(analysis: Analysis, deviation: float) -> None:
    moved = analysis.movements[1]
    assert moved.clearance is not None
    tolerated = 0.005 if math.isnan(deviation) else min(deviation, 0.005)
    for beyond, ok in ((-2e-5, True), (2e-5, False)):
        short = tolerated + 1e-4 + beyond
        near = replace(moved.clearance, least=0.02 - short, contact_margin=-short)
        result = replace(moved, tool_deviation=deviation, clearance=near)
        one = replace(analysis, steps=(result,))
        told = {check.name.split(" on ")[0]: check.ok for check in findings(one)}
        assert (told["clearance"], told["allowed contacts"]) == (ok, ok)


@pytest.mark.parametrize(
    ("certified", "planned", "kept", "whose"),
    [
        (True, 0.006, 0.006, "6.0 mm, the certified plan's clearance"),
        (False, 0.006, 0.02, "20.0 mm, the safety distance"),
        (True, 0.05, 0.02, "20.0 mm, the safety distance"),
        (True, math.inf, 0.02, "20.0 mm, the safety distance"),
    ],
)
def test_a_plan_with_a_smaller_safety_distance_is_held_against_its_own_clearance(
    analysis: Analysis, certified: bool, planned: float, kept: float, whose: str
) -> None:
    moved = analysis.movements[1]
    assert moved.clearance is not None
    report = replace(moved.step.movement.report, certified=certified, min_clearance=planned)
    step = replace(moved.step, movement=replace(moved.step.movement, report=report))
    for beyond, ok in ((-2e-5, True), (2e-5, False)):
        near = replace(moved.clearance, least=kept - 1e-4 - beyond)
        result = replace(moved, step=step, tool_deviation=0.0, clearance=near)
        checks = findings(replace(analysis, steps=(result,)))
        (clearance,) = [check for check in checks if check.name.startswith("clearance on")]
        assert clearance.ok == ok
        assert clearance.note.endswith(f"to keep: {whose}")


def test_checks_hold_for_a_run_as_planned(analysis: Analysis) -> None:
    checks = findings(analysis, Tolerances(table_2_rows=8, safety_distance=-1.0))
    assert [check.name for check in checks if not check.ok] == []
    assert len(checks) > 20


def test_a_movement_that_took_more_than_planned_fails_its_check(
    new_run: Callable[[], Any], tmp_path: Path
) -> None:
    run = new_run()
    goal = HOME + np.radians([60.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    run.rest(0.1, Mode.STAND_ON_MOTORS, HOME, "gripper")
    run.move(1.0, HOME, goal, "gripper", PlannedMovement(kind="regional", to_station="table"))
    checks = findings(analyse(read_recording(run.record(tmp_path / "a.mcap", plan_factor=0.5))))
    (energy,) = [check for check in checks if check.name.startswith("energy of")]
    assert not energy.ok
    assert energy.measured == pytest.approx(2.0 * energy.expected, rel=1e-6)


def test_a_step_without_an_end_is_a_finding(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    cut = replace(recording, events=recording.events[:-1])
    failed = [check for check in findings(analyse(cut)) if check.name.startswith("end of")]
    assert [check.note for check in failed] == ["open"]


def test_joint_states_lie_on_a_grid_but_for_hibernation(analysis: Analysis) -> None:
    assert analysis.grid.clean
    assert analysis.grid.excused == 2


def test_gaps_and_stray_stamps_are_counted(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    joints, kept = recording.joints, np.ones(len(recording.joints.time), dtype=bool)
    kept[[10, 11]] = False
    stamps = joints.stamp_ns[kept].copy()
    stamps[50] += 1000
    fields = {name: getattr(joints, name)[kept] for name in ("time", "position", "velocity", "effort")}
    check = check_grid(replace(joints, stamp_ns=stamps, **fields), recording.power)
    assert len(check.gaps) >= 1
    assert check.gaps[0][1] == pytest.approx(0.006)
    assert check.off_grid >= 1
    assert not check.clean


def test_the_meter_integrates_a_constant_power_exactly(new_run: Callable[[], Any], tmp_path: Path) -> None:
    run = new_run()
    run.rest(1.0, Mode.BUS_POWER_OFF, HOME, "gripper")
    meter = Meter(read_recording(run.record(tmp_path / "a.mcap")).power)
    assert meter.energy(0.2, 0.7) == pytest.approx(205.0 * 0.5)
    assert meter.base(0.2, 0.7) == pytest.approx(205.0 * 0.5)
    assert meter.peak(0.2, 0.7) == pytest.approx(205.0)


def test_the_load_is_unknown_between_two_that_differ() -> None:
    timeline = LoadTimeline(((0.0, "none"), (1.0, "none"), (2.0, "gripper"), (3.0, "gripper")))
    assert list(timeline.certain(5.0)) == [(0.0, 1.0, "none"), (2.0, 5.0, "gripper")]
    assert timeline.at(1.5) == "none"
    assert timeline.at(-1.0) == ""


def test_a_step_of_the_base_load_tells_when_the_tool_came(new_run: Callable[[], Any], tmp_path: Path) -> None:
    run = new_run()
    run.rest(1.0, Mode.STAND_ON_MOTORS, HOME, "none")
    run.rest(2.0, Mode.STAND_ON_MOTORS, HOME, "gripper")
    recording = read_recording(run.record(tmp_path / "a.mcap"))
    stale = (
        TextEvent(0.0, "load", "none"),
        TextEvent(1.6, "load", "none"),
        TextEvent(2.6, "load", "gripper"),
    )
    (none, gripper) = load_timeline(replace(recording, loads=stale)).certain(3.0)
    assert none[1] == pytest.approx(1.0, abs=0.011)
    assert gripper[0] == pytest.approx(1.0, abs=0.011)


@pytest.mark.parametrize(
    ("load", "attach", "detach", "expected"),
    [
        ("none", "gripper", "", "gripper"),
        ("gripper", "part", "", "gripper+part"),
        ("gripper+part", "", "part", "gripper"),
        ("gripper", "", "gripper", "none"),
    ],
)
def test_loads_follow_the_steps(load: str, attach: str, detach: str, expected: str) -> None:
    assert after(load, attach, detach) == expected


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
    assert [check.ok for check in findings(empty)] == [False]
