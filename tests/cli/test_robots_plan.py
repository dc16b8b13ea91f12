"""`ir plan` of a cell with several robots: programs, zones, and what is saved."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import ir_description
from ir_cli.main import main


@pytest.mark.long
def test_the_joint_cycle_is_printed_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "robots.png"
    given = ["plan", "two_robots", "--cycle-time", "14", "-o", str(picture)]
    assert main([*given, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["certified"]
    assert answer["period"] == pytest.approx(14.0, abs=1e-3)
    assert answer["joules"] == pytest.approx(sum(e["joules"] for e in answer["robots"].values()))
    assert answer["joules"] < answer["full_speed"]
    orders = [(row["robot"], row["order"]) for row in answer["zones"]]
    assert orders == [("right", "1"), ("left", "2")]
    assert {row["robot"] for row in answer["steps"]} == {"left", "right"}
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (["--parts-per-hour", "3"], "--parts-per-hour belongs to one robot"),
        (["--stations", "table_seat"], "name one, as two_robots@NAME"),
        (["-o", "out/plan.mcap"], "out/plan.mcap belongs to one robot"),
    ],
)
def test_what_belongs_to_one_robot_is_refused(
    given: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "two_robots", *given]) == 2
    assert sentence in capsys.readouterr().err


def test_one_of_the_robots_is_planned_by_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "two_robots@right"]) == 0
    assert "outfeed_place" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["two_robots", "two_robots@left", "two_robots@right"])
def test_a_robot_is_checked_at_its_own_stations(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", name]) == 0
    said = capsys.readouterr().out
    assert "error" not in said
    assert "warning" not in said
    assert ("infeed_pick" in said) == (name != "two_robots@right")
    assert ("outfeed_place" in said) == (name != "two_robots@left")


def test_a_station_that_no_program_visits_is_checked_for_the_nearest_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (Path(ir_description.__file__).parent / "data/robot_cells/two_robots.yaml").read_text()
    file = tmp_path / "cell.yaml"
    far = "      - {name: far, pose: {xyz: [4, 0, 2], abc_deg: [0, 90, 0]}}\n"
    file.write_text(text.replace("    stations:\n", "    stations:\n" + far, 1))
    assert main(["check", str(file), "--json"]) == 1
    cells = json.loads(capsys.readouterr().out)["cells"]
    found = [[f["subject"] for f in cell["findings"] if f["severity"] == "error"] for cell in cells]
    assert found == [["far"], []]


def test_a_program_that_cannot_be_repeated_is_an_error_of_the_check(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (Path(ir_description.__file__).parent / "data/robot_cells/two_robots.yaml").read_text()
    file = tmp_path / "cell.yaml"
    file.write_text(text.replace("table_seat, detach: gear, dwell: 0.5}", "table_seat}", 1))
    assert main(["check", f"{file}@left"]) == 1
    assert "the program of left ends with gear in the gripper" in capsys.readouterr().out


def test_a_limit_of_the_peak_belongs_to_several_robots(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "demo", "--peak-power", "20"]) == 2
    assert "--peak-power needs a CELL with several robots" in capsys.readouterr().err


def test_a_robot_that_a_cell_does_not_have_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "two_robots@middle"]) == 2
    assert "robot 'middle' is unknown; known are left, right" in capsys.readouterr().err
