"""A programme of excitation is certified, hangs together and says what it identifies."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from ir_cli.excitation_programme import Design, straight
from ir_cli.main import main
from ir_cli.planning import planner_of
from ir_cli.traces import read_trace
from ir_description import data_sheet, load_power_data
from ir_recorder.measure import PowerModel


@pytest.mark.long
@pytest.mark.parametrize("cell", ["open", pytest.param("demo", marks=pytest.mark.long)])
def test_every_movement_is_certified_and_begins_where_the_one_before_ended(
    cell: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["energy", "excite", cell, "--seconds", "12", "--postures", "1"]
    words += ["--output", str(tmp_path)]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    page = yaml.safe_load((tmp_path / "programme.yaml").read_text())
    planner = planner_of(cell)
    names = planner.cell.robot.joint_names
    here = np.array(planner.cell.machine_home)
    movements = [step for step in page["steps"] if "trajectory" in step]
    assert len(movements) == found["movements"] >= 4
    for step in movements:
        trajectory = read_trace(tmp_path / step["trajectory"], names)
        np.testing.assert_allclose(trajectory.positions[0], here, atol=1e-9)
        here = trajectory.positions[-1]
        assert planner.evaluate(
            trajectory, safety_distance=0.02, load=step["load"]
        ).verification.certified
    assert {step["mode"] for step in page["steps"] if "mode" in step} >= {
        "STAND_ON_BRAKES",
        "BUS_POWER_OFF",
    }
    assert set(found["identified"]).isdisjoint(found["missing"])
    assert "watts.HIBERNATION" in found["missing"]
    assert any("hibernate" in sentence for sentence in found["advice"])
    with (tmp_path / movements[0]["trajectory"]).open() as file:
        assert next(csv.reader(file))[0] == "time"


def test_the_choice_prefers_what_the_prior_does_not_know() -> None:
    planner = planner_of("open")
    prior = data_sheet()
    cell = planner.cell
    model = PowerModel(cell.robot, load_power_data().dc_link, cell.base_pose, prior)
    design = Design(model, prior)
    home = np.array(cell.machine_home)
    before = design.identified()
    assert before.found == ()
    from ir_cli.excitation_programme import Excursion

    def excursion(axis: int) -> Excursion:
        there = home + 0.8 * np.eye(6)[axis]
        ends = (
            straight(cell.robot.joint_names, *pair, 2.0) for pair in ((home, there), (there, home))
        )
        return Excursion(f"A{axis + 1}", 0, "none", *ends)

    pool = [excursion(axis) for axis in range(6)]
    chosen = design.choose(pool, [design.of(each, ()) for each in pool], 1e9)
    assert {each.name for each in chosen} == {each.name for each in pool}  # time for all
    left = design.identified().left
    for axis in range(6):
        assert left[prior.index(f"coulomb.joint_a{axis + 1}")] < 1.0
    assert left[prior.index("watts.HIBERNATION")] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--seconds", "0", "--seconds is 0 s, must be above 0 and at most 3600 s"),
        ("--seconds", "nan", "--seconds is nan s, must be above 0 and at most 3600 s"),
        ("--seconds", "3600.0001", "--seconds is 3600.0001 s, must be above 0 and at most 3600 s"),
        ("--postures", "21", "--postures is 21, must be 1 to 20"),
    ],
)
def test_a_programme_out_of_bounds_is_refused_with_its_value(
    option: str, value: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["energy", "excite", "demo", option, value]) == 2
    assert said in capsys.readouterr().err
