"""Several robots in one file: each has a cell of its own, which is a cell like any other."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from ir_description import (
    CellFileError,
    RobotCells,
    UnknownNameError,
    cell_from_yaml,
    cell_hash,
    cell_to_yaml,
    load_cell,
    load_robot_cells,
)
from ir_description.library import bundled_robot_cells, cell_file_errors, robot_in
from ir_kernels import Chain

TEXT = (files("ir_description") / "data" / "robot_cells" / "two_robots.yaml").read_text("utf-8")


def read(folder: Path, text: str) -> RobotCells:
    path = folder / "cell.yaml"
    path.write_text(text)
    found = load_robot_cells(path)
    assert found is not None
    return found


@pytest.mark.parametrize("name", bundled_robot_cells())
def test_the_cell_of_each_robot_is_a_cell_that_survives_its_file(name: str) -> None:
    cells = load_robot_cells(name)
    assert cells is not None
    for robot, cell in zip(cells.robots, cells.cells, strict=True):
        assert cell_hash(load_cell(f"{name}@{robot}")) == cell_hash(cell)
        assert cell_to_yaml(cell_from_yaml(cell_to_yaml(cell))) == cell_to_yaml(cell)
        assert cell.name == f"{name}.{robot}"


def test_machines_are_shared_and_feet_of_others_are_machines() -> None:
    cells = load_robot_cells("two_robots")
    assert cells is not None
    shared = [
        {machine.name for machine in cell.equipment} - {"left", "right"} for cell in cells.cells
    ]
    assert shared[0] == shared[1]
    for robot, cell in zip(cells.robots, cells.cells, strict=True):
        (other,) = set(cells.robots) - {robot}
        foot = cell.machine(other)
        own = cells.of_robot(other)
        fixed = [capsule for capsule in own.robot.capsules if capsule.link == 0]
        links = Chain(own.robot, own.base_pose).link_poses(own.park[None])[0]
        assert len(foot.bodies) == len(fixed)
        for body, capsule in zip(foot.world_bodies(), fixed, strict=True):
            half = np.array([0.0, 0.0, body.size[1] / 2.0])
            ends = [body.pose[:3, :3] @ (side * half) + body.pose[:3, 3] for side in (-1.0, 1.0)]
            placed = [links[0][:3, :3] @ p + links[0][:3, 3] for p in (capsule.p0, capsule.p1)]
            assert ends == [pytest.approx(place, abs=1e-9) for place in placed]


def test_stations_allow_what_the_own_tool_may_touch(tmp_path: Path) -> None:
    cells = read(tmp_path, TEXT)
    for robot in cells.robots:
        contacts = cells.of_robot(robot).contacts_at("table_seat")
        fingers = {contact.body_a for contact in contacts} - {"gear_held"}
        assert fingers == {f"{robot}_finger_1", f"{robot}_finger_2"}


def test_a_part_lies_where_the_robots_program_begins_with_it() -> None:
    assert load_cell("two_robots@left").part("gear").station == "infeed_pick"
    assert load_cell("two_robots@right").part("gear").station == "table_seat"


def test_where_one_robot_is_needed_its_name_is_asked_for() -> None:
    with pytest.raises(CellFileError, match=r"the robots left, right, here one is needed.*@left"):
        load_cell("two_robots")
    with pytest.raises(UnknownNameError, match="known are left, right"):
        load_cell("two_robots@middle")
    with pytest.raises(UnknownNameError, match="demo has one"):
        load_cell("demo@left")
    assert load_robot_cells("demo") is None


@pytest.mark.parametrize(
    ("name", "named"),
    [
        ("two_robots@left", ("two_robots", "left")),
        ("folder/a@b.yaml", ("folder/a@b.yaml", "")),
        ("folder/a@b.yaml@left", ("folder/a@b.yaml", "left")),
        ("user@host/cell", ("user@host/cell", "")),
        ("demo", ("demo", "")),
    ],
)
def test_a_robot_is_named_behind_its_cell(name: str, named: tuple[str, str]) -> None:
    assert robot_in(name) == named


BROKEN = {
    "one robot": (TEXT[TEXT.index("  - name: right") :], "", "has 1 entries, must have 2 to 6"),
    "a name twice": ("- name: right\n    robot", "- name: left\n    robot", "robot left is there"),
    "a machine's name": (
        "- name: right\n    robot",
        "- name: table\n    robot",
        "table is there twice",
    ),
    "unknown part": ("starts: {gear", "starts: {geer", "part 'geer' is unknown"),
    "unknown place": ("table_seat} #", "tabel_seat} #", "station 'tabel_seat' is unknown"),
    "unknown finger": (
        "[left_finger_1, gear_l",
        "[middle_finger, gear_l",
        "'middle_finger' is unknown",
    ),
    "a touch of robots": (
        "[right_finger_1, gear_lying",
        "[right_finger_1, left_finger_1",
        "robots keep apart everywhere",
    ),
    "what one has": ("floor: true", "tool: {}", "unknown key 'tool'"),
    "a wrong step": (
        "{station: table_seat, attach",
        "{station: table, attach",
        "'table' is unknown",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_wrong_is_said_with_its_line(case: str, tmp_path: Path) -> None:
    before, after, sentence = BROKEN[case]
    assert before in TEXT
    with pytest.raises(CellFileError, match=r"cell.yaml:\d+: ") as caught:
        read(tmp_path, TEXT.replace(before, after, 1))
    assert sentence in str(caught.value)
    assert any(sentence in str(error) for error in cell_file_errors(tmp_path / "cell.yaml"))


def test_the_order_of_robots_changes_no_cell(tmp_path: Path) -> None:
    begin = TEXT.index("  - name: left")
    middle = TEXT.index("  - name: right")
    turned = TEXT[:begin] + TEXT[middle:] + "\n" + TEXT[begin:middle]
    cells = read(tmp_path, turned)
    assert cells.robots == ("right", "left")
    for robot in cells.robots:
        assert cell_hash(cells.of_robot(robot)) == cell_hash(load_cell(f"two_robots@{robot}"))
