"""Recordings of a robot on a rail: what they say is what the same arm says that stands there."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_msgs.msg import PlannedMovement
from ir_msgs_py.modes import Mode
from ir_recorder import Analysis, analyse, findings, read_recording
from ir_recorder.report import report_html
from ir_recorder.report.step_table import write_table
from ir_values.arrays import FloatArray

RAIL = (
    "rail: {axis: [0, 1, 0], travel: [-3, 3], velocity: 1.89, acceleration: 1.5, "
    "carriage_mass: 750}\n"
)
TABLE = np.radians([-32.0, -60.0, 95.0, 0.0, 55.0, 30.0])
HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
READING = 1e-3  # relative: a reading at an end may belong to the rest beside it
SAME = 1e-9  # relative: coordinates of bodies are taken from another origin


def recorded(
    run: Any, folder: Path, name: str, cell: str, ends: tuple[FloatArray, FloatArray]
) -> Analysis:
    """The analysis of a movement between two configurations, and of a rest on motors after it."""
    run.cell = cell
    step = PlannedMovement(kind="regional", from_station="home", to_station="table")
    run.move(1.5, *ends, "gripper", step)
    run.pause(0.4, Mode.STAND_ON_MOTORS, ends[1], "gripper", "table", "STAND_ON_MOTORS")
    return analyse(read_recording(run.record(folder / f"{name}.mcap")))


@pytest.mark.parametrize("place", [0.0, -0.7, 1.3])
def test_a_carriage_that_stands_says_what_the_arm_says_that_stands_there(
    place: float, new_run: Callable[[], Any], cell_yaml: str, tmp_path: Path
) -> None:
    """It has to be held against the arm's reactions, which costs what its own motor takes."""
    base = f"base: {{xyz: [0, {place}, 0]}}\n"
    arm = recorded(new_run(), tmp_path, "arm", cell_yaml + base, (HOME, TABLE))
    there = (np.insert(HOME, 0, place), np.insert(TABLE, 0, place))
    railed = recorded(new_run(), tmp_path, "rail", cell_yaml + RAIL, there)
    assert railed.problems == arm.problems
    for ours, theirs in zip(railed.steps, arm.steps, strict=True):
        np.testing.assert_allclose(ours.joint_energy[1:], theirs.joint_energy, rtol=SAME)
        assert 0.0 <= ours.joint_energy[0] < 20.0
        assert ours.seconds == theirs.seconds
        assert ours.base_energy == theirs.base_energy
    moved = railed.steps[0]
    stood = arm.steps[0]
    held = moved.energy - stood.energy
    assert 0.0 < held < moved.joint_energy[0]
    assert moved.torque_energy - stood.torque_energy == pytest.approx(held, abs=1e-3)
    assert moved.indirect_energy - stood.indirect_energy == pytest.approx(held, abs=0.05)
    assert moved.second_opinion - stood.second_opinion == pytest.approx(held, abs=0.05)
    assert moved.clearance is not None
    assert stood.clearance is not None
    assert moved.clearance.least == pytest.approx(stood.clearance.least, abs=1e-9)
    assert moved.clearance.least_pair == stood.clearance.least_pair
    said = [(each.name, each.ok) for each in findings(railed)]
    assert said == [(each.name, each.ok) for each in findings(arm)]


def test_a_moving_carriage_has_charts_bars_and_a_column_of_its_own(
    new_run: Callable[[], Any],
    cell_yaml: str,
    tmp_path: Path,
    data_of: Callable[[str], dict[str, Any]],
) -> None:
    ends = (np.insert(HOME, 0, -0.5), np.insert(TABLE, 0, 0.75))
    analysis = recorded(new_run(), tmp_path, "rail", cell_yaml + RAIL, ends)
    moved = analysis.steps[0]
    assert moved.indirect_energy == pytest.approx(moved.energy, rel=0.01)
    assert moved.second_opinion == pytest.approx(moved.indirect_energy, rel=1e-9)
    page = report_html(analysis, findings(analysis))
    charts = {chart["name"]: chart for chart in data_of(page)["axes"]}
    assert charts["position"]["count"] == 6
    assert charts["position of E1"]["count"] == 1
    assert charts["position of E1"]["unit"] == "m"
    assert charts["position of E1"]["limits"] == [[-3.0, 3.0]]
    assert charts["speed of E1"]["unit"] == "m/s"
    assert charts["force of E1"]["unit"] == "N"
    assert re.search(r"axis E1 takes [\d.\s]+ k?J", page)
    power = analysis.recording.power
    assert power is not None
    moving = power.time <= 1.5 + 1e-6
    joules = float(power.joint_power[moving, 0].sum()) * 0.01
    table = write_table([analysis], tmp_path / "steps.csv").read_text()
    row = next(csv.DictReader(StringIO(table)))
    assert float(row["axis_e1_net_j"]) == pytest.approx(joules, rel=READING)
    assert float(row["axis_6_net_j"]) == pytest.approx(analysis.steps[0].joint_energy[6])
