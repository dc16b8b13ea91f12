"""`ir plan` of a cell with several robots: programs, zones, and what is saved."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ir_cli.main import main


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
    assert main(["check", "two_robots"]) == 1
    assert "CELL@left" in capsys.readouterr().err
