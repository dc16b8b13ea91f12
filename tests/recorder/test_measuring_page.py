"""docs/measuring.md: its commands lead from a programme of excitation to a plan and a report."""

from __future__ import annotations

import contextlib
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from ir_cli.excitation_programme import (
    MODES,
    Identified,
    Programme,
    ProgrammeStep,
    straight,
    write_programme,
)
from ir_cli.main import main
from ir_cli.traces import read_trace
from ir_description import data_sheet, load_cell, load_power_data
from ir_description.library import load_power_parameters
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder import Analysis, analyse
from ir_recorder.measure import PowerModel, planned_samples
from ir_recorder.traces import read_traces

PAGE = (Path(__file__).parents[2] / "docs" / "measuring.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    ir (.*)$", PAGE.split("## From a programme to a plan")[1], re.M)
SHORT = ["--seconds", "8", "--postures", "1"]


def words(command: str) -> list[str]:
    """A command of the page; a programme of a few seconds where it says nothing of its length."""
    return [*shlex.split(command), *(SHORT if command.startswith("energy excite") else [])]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A programme of two movements and three modes, and what a plant showed."""
    place = tmp_path_factory.mktemp("excitation")
    home = np.array(load_cell("demo").machine_home)
    there = home + np.array([0.3, 0.0, 0.0, 0.0, 0.2, 0.0])
    steps = (
        *(ProgrammeStep(mode, "gripper", mode=mode, seconds=1.5) for mode in MODES[:3]),
        ProgrammeStep("out", "gripper", straight(JOINT_NAMES, home, there, 1.5)),
        ProgrammeStep("back", "gripper+gear", straight(JOINT_NAMES, there, home, 1.5)),
    )
    write_programme(Programme(steps, Identified((), np.zeros(0))), place, "demo")
    assert main(["energy", "drive", str(place), "--plant", "typical:3"]) == 0
    return place


@pytest.mark.long
def test_the_commands_of_the_page_lead_from_a_programme_to_a_plan(
    tmp_path: Path, demo_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "demo.mcap").write_bytes(demo_file.read_bytes())
    with contextlib.chdir(tmp_path):
        for command in COMMANDS:
            assert main(words(command)) == 0, command
        found = load_power_parameters("out/press_line_2.yaml")
    assert found.name == "press_line_2"
    sheet = data_sheet()
    known = sheet.deviation > 0.0
    left = found.deviation[: len(known)][known] / sheet.deviation[known]  # centres follow
    assert left.max() < 1.0 + 1e-6
    assert left.min() < 0.7  # of four movements
    assert "press_line_2" in capsys.readouterr().out


@pytest.mark.long
def test_what_a_plant_showed_is_a_trace_with_modes_and_loads(folder: Path) -> None:
    (trace,) = read_traces(folder / "run.csv")
    assert set(trace.texts["load"]) == {"gripper", "gripper+gear"}
    assert {"STAND_ON_MOTORS", "MOVING", "STAND_ON_BRAKES", "BUS_POWER_OFF"} <= set(
        trace.texts["mode"]
    )
    joules = trace.joules()
    assert joules is not None
    assert (np.diff(joules) > 0.0).all()  # there is always a base load
    steps = yaml.safe_load((folder / "programme.yaml").read_text())["steps"]
    last = [step["trajectory"] for step in steps if "trajectory" in step][-1]
    end = read_trace(folder / last, JOINT_NAMES).positions[-1]
    q = trace.joints(JOINT_NAMES)
    assert q is not None
    np.testing.assert_allclose(q[-1], end, atol=1e-3)  # what the feedback leaves


@pytest.mark.long
@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("trajectory", "../001.csv", "must be the name of a file in the same folder"),
        ("trajectory", "999.csv", "999.csv"),
        ("mode", "ASLEEP", "ASLEEP"),
        ("load", "anvil", "anvil"),
    ],
)
def test_a_programme_that_makes_no_sense_is_refused_by_name(
    key: str,
    value: str,
    said: str,
    folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = yaml.safe_load((folder / "programme.yaml").read_text())
    step = next(step for step in page["steps"] if key in step)
    step[key] = value
    (tmp_path / "programme.yaml").write_text(yaml.safe_dump({**page, "steps": [step]}))
    assert main(["energy", "drive", str(tmp_path)]) != 0
    assert said in capsys.readouterr().err


def test_a_load_that_the_cell_does_not_have_is_no_load_of_a_fit(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = (folder / "run.csv").read_text().replace(",gripper+gear", ",gripper+anvil")
    (tmp_path / "run.csv").write_text(rows)
    assert main(["energy", "fit", str(tmp_path / "run.csv"), "--cell", "demo"]) != 0
    assert "load 'anvil' is unknown, known are gear, gripper, none" in capsys.readouterr().err


def test_a_report_predicts_by_the_parameters_that_it_is_given(analysis: Analysis) -> None:
    cell = load_cell("demo")
    sheet = data_sheet()
    here = np.array(cell.machine_home)
    there = np.array(cell.machine_home) + 0.3
    still = np.zeros((2, 6))
    ends = np.stack([here, there])
    moved = JointTrajectory.from_seconds(JOINT_NAMES, [0.0, 1.5], ends, still, still)
    events = [
        replace(event, movement=replace(event.movement, trajectory=moved))
        if event.movement.trajectory_id
        else event
        for event in analysis.recording.events
    ]
    mean = sheet.mean.copy()
    mean[sheet.places("viscous")] *= 1.3
    fitted = replace(sheet, name="cell_3", mean=mean, covariance=0.04 * sheet.covariance)
    recording = replace(analysis.recording, events=tuple(events))
    (step, *_) = [
        s.step for s in analyse(recording, fitted).steps if s.step.movement.trajectory is not None
    ]
    report = step.movement.report
    assert report.power_parameters == "cell_3"
    assert analysis.cell is not None
    model = PowerModel(
        analysis.cell.robot, load_power_data().dc_link, analysis.cell.base_pose, fitted
    )
    held = analysis.cell.loads("")
    prepared = model.prepare(planned_samples(moved, held, fitted.modes))
    joules = [
        1.5 * model.watts(draw, prepared).mean() for draw in fitted.draws(300, 1)
    ]  # no slopes here
    low, high = np.percentile(joules, [5.0, 95.0])
    assert step.movement.load == "gripper"
    assert report.energy == pytest.approx(1.5 * model.watts(mean, prepared).mean(), rel=1e-6)
    assert report.energy_low == pytest.approx(low, rel=0.02)
    assert report.energy_high == pytest.approx(high, rel=0.02)


def test_a_report_says_that_it_lacks_the_parameters_of_the_plan(analysis: Analysis) -> None:
    events = [
        replace(
            e,
            movement=replace(
                e.movement, report=replace(e.movement.report, power_parameters="cell_3")
            ),
        )
        for e in analysis.recording.events
    ]
    found = analyse(replace(analysis.recording, events=tuple(events)))
    assert any(
        "cell_3" in problem and "--power-parameters" in problem for problem in found.problems
    )
