"""A fleet: sums over robots and shifts, hostile files by a sentence each, and the files that are
written.
"""

from __future__ import annotations

import csv
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from ir_cli.main import main
from ir_recorder import Analysis
from ir_recorder.analysis.production import PREDICTED
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_figures import by_measure, by_mode, by_movement, robots_of
from ir_recorder.report.fleet_members import (
    Member,
    fleet_columns,
    member_of,
    read_members,
    recordings_below,
    write_fleet_table,
)
from ir_recorder.report.prices import Costs
from ir_values.files import FileRoots


@pytest.fixture
def member(analysis: Analysis) -> Member:
    found = member_of(analysis, "left")
    assert found is not None
    return found


def test_the_sums_are_those_of_the_members(member: Member) -> None:
    costs = Costs()
    cycle = member.cycle
    modes = {k: replace(v, energy=2.0 * v.energy) for k, v in cycle.modes.items()}
    energies = {name: 2.0 * getattr(cycle, name) for name in ("energy", "low", "high")}
    other = replace(member, robot="right", cycle=replace(cycle, modes=modes, **energies))
    robots = robots_of([member, other], costs)
    assert [robot.name for robot in robots] == ["right", "left"]
    assert robots[0].yearly.value == pytest.approx(2.0 * costs.energy_of_year(member.cycle).value)
    by_robot = {robot.name: robot.yearly.value for robot in robots}
    found = by_mode([member, other], costs)
    for robot, yearly in by_robot.items():
        assert sum(own.get(robot, 0.0) for own in found.values()) == pytest.approx(yearly)
    moved = by_movement([member], costs)
    assert sum(sum(own.values()) for own in moved.values()) <= 1.001 * by_robot["left"]
    measures = by_measure([member], costs)
    assert all(
        0.0 <= joules <= by_robot["left"] for own in measures.values() for joules in own.values()
    )


def test_robots_stand_in_the_order_of_the_years_that_are_shown(member: Member) -> None:
    """Of a plan that nobody drove that is today's program, whatever the plan takes."""
    costs = Costs()
    cycle = replace(member.cycle, origin=PREDICTED)
    for factor in (0.1, 10.0):
        energies = {name: factor * getattr(cycle, name) for name in ("energy", "low", "high")}
        planned = replace(member, robot="planned", cycle=replace(cycle, **energies))
        shown = [robot.now.value for robot in robots_of([member, planned], costs)]
        assert len(set(shown)) == 2
        assert shown == sorted(shown, reverse=True)


def test_shifts_of_one_robot_are_averaged(member: Member) -> None:
    """Law: the same shift twice changes nothing."""
    costs = Costs()
    (once,) = robots_of([member], costs)
    (twice,) = robots_of([member, member], costs)
    assert twice == replace(once, recordings=2)
    assert by_mode([member, member], costs) == by_mode([member], costs)
    assert by_movement([member, member], costs) == by_movement([member], costs)


def test_the_page_and_the_table_carry_texts_safely(member: Member) -> None:
    evil = replace(member, robot="<img src=x>", cell="=1+1")
    page = fleet_html([evil], ["<b>bad</b>: left out"])
    assert "<img" not in page
    assert "<b>bad</b>" not in page
    columns = fleet_columns([evil])
    assert {len(column) for column in columns.values()} == {len(columns["robot"])}


def test_the_command_sums_folders_up_and_names_what_it_leaves_out(
    demo_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for robot in ("left", "right"):
        (tmp_path / robot).mkdir()
        shutil.copy(demo_file, tmp_path / robot / "monday.mcap")
    (tmp_path / "bad.mcap").write_bytes(b"not a recording")
    (tmp_path / "empty.mcap").write_bytes(b"")
    page = tmp_path / "out" / "fleet.html"
    table = tmp_path / "out" / "fleet.csv"
    arguments = [
        "fleet",
        str(tmp_path),
        "-o",
        str(page),
        "--table",
        str(table),
        "--root",
        str(tmp_path),
    ]
    assert main(arguments) == 0
    said = capsys.readouterr().err
    assert "bad.mcap: left out" in said
    assert "empty.mcap: left out" in said
    assert "2 robots: 2 simulated runs" in page.read_text(encoding="utf-8")
    with table.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["what"] == "cycle"]
    assert [row["robot"] for row in rows] == ["left", "right"]


def test_what_is_no_regular_file_is_left_out_of_a_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A FIFO held the command up for ever."""
    os.mkfifo(tmp_path / "a.mcap")
    (tmp_path / "b.mcap").mkdir()
    arguments = ["fleet", str(tmp_path), "-o", str(tmp_path / "fleet.html")]
    assert main(arguments) == 1
    said = capsys.readouterr().err
    for name in ("a.mcap", "b.mcap"):
        assert f"{tmp_path / name}: left out" in said
        assert "is not a regular file" in said


def fleet(tmp_path: Path, *paths: Path) -> tuple[dict[str, int], list[str]]:
    """Recordings by robot, and what is said."""
    said: list[str] = []
    members = read_members(paths, FileRoots.of([tmp_path]), said.append)
    robots = [member.robot for member in members]
    return {name: robots.count(name) for name in robots}, said


def test_robots_of_one_name_in_two_halls_are_two(demo_file: Path, tmp_path: Path) -> None:
    """They were averaged, and half of their energy was gone."""
    for place in ("north/r1", "north/r2", "south/r1"):
        (tmp_path / place).mkdir(parents=True)
        shutil.copy(demo_file, tmp_path / place / "monday.mcap")
    said: list[str] = []
    halls = [tmp_path / "north", tmp_path / "south"]
    found = recordings_below(halls, FileRoots.of([tmp_path]), said.append)
    assert [file.robot for file in found] == ["north/r1", "r2", "south/r1"]
    assert sum("is a copy of" in one and "another robot's" in one for one in said) == 2
    direct = [tmp_path / place / "monday.mcap" for place in ("north/r1", "south/r1")]
    named = recordings_below(direct, FileRoots.of([tmp_path]), said.append)
    assert len({file.robot for file in named}) == 2


def test_copies_and_empty_folders_are_named(demo_file: Path, tmp_path: Path) -> None:
    for place in ("a", "none"):
        (tmp_path / "all" / place).mkdir(parents=True)
    for name in ("monday", "monday (1)"):
        shutil.copy(demo_file, tmp_path / "all" / "a" / f"{name}.mcap")
    paths = (tmp_path / "all", tmp_path / "all" / "none", tmp_path / "all" / "a" / "monday.mcap")
    found, said = fleet(tmp_path, *paths)
    assert found == {"a": 1}
    for words in (
        "none: holds no recordings",
        "left out: it is a copy of",
        "monday.mcap: named twice",
    ):
        assert sum(words in one for one in said) == 1, words


def test_a_program_that_was_not_driven_to_the_end_is_no_cycle(
    demo_file: Path, tmp_path: Path
) -> None:
    """A recording cut after eight of 27 steps was a cycle of 10 s, with more kWh a year than the
    whole.
    """
    whole = demo_file.read_bytes()
    shutil.copy(demo_file, tmp_path / "whole.mcap")
    (tmp_path / "cut.mcap").write_bytes(whole[: 6 * len(whole) // 10])
    found, said = fleet(tmp_path, tmp_path)
    assert found == {"whole": 1}
    assert any(
        "cut.mcap: left out: its program was not driven to the end" in one for one in said
    ), said


def test_several_cycles_of_a_recording_are_one_on_average(analysis: Analysis) -> None:
    once = member_of(analysis, "r")
    twice = member_of(replace(analysis, steps=(*analysis.steps, *analysis.steps)), "r")
    assert once is not None
    assert twice is not None
    assert twice.cycle.energy == pytest.approx(0.5 * once.cycle.energy)
    assert twice.cycle.seconds == pytest.approx(0.5 * once.cycle.seconds)
    said: list[str] = []
    more = member_of(
        replace(analysis, steps=(*analysis.steps, analysis.steps[0])), "r", said.append
    )
    assert more is not None
    assert any("its last cycle was not driven to the end" in one for one in said)


def test_the_table_as_parquet_has_the_same_columns(member: Member, tmp_path: Path) -> None:
    stored = parquet.read_table(write_fleet_table([member], tmp_path / "fleet.parquet")).to_pydict()
    np.testing.assert_equal(stored, fleet_columns([member]))


def test_nothing_to_sum_up_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["energy", "fleet", str(tmp_path), "--root", str(tmp_path)]) == 1
    assert "no recording could be used" in capsys.readouterr().err
