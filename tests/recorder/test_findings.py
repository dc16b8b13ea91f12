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
from ir_recorder import Analysis, Tolerances, analyse, findings, read_recording

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


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
        held = {check.name.split(" on ")[0]: check.ok for check in findings(one)}
        assert (held["clearance"], held["allowed contacts"]) == (ok, ok)


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
