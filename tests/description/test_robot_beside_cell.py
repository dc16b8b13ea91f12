"""A robot in a file beside the cell file: read, written out, hashed, refused where it is wrong."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from ir_description import (
    CellFileError,
    cell_from_yaml,
    cell_hash,
    cell_to_yaml,
    check_cell,
    load_cell,
    load_robot,
)
from ir_description.files import robot_file_errors
from ir_description.library import robot_named
from ir_values.errors import RobotFileError

ROBOTS = files("ir_description") / "data" / "robots"
TEXT = (ROBOTS / "ur10e.yaml").read_text(encoding="utf-8")
CELL = "format: ir_cell/1\nname: own\nrobot: {robot}\n"
POWER = (files("ir_description") / "data" / "power" / "kr_c4.yaml").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "arm.yaml").write_text(TEXT.replace("name: ur10e", "name: my_arm", 1))
    (tmp_path / "cell.yaml").write_text(CELL.format(robot="own/arm.yaml"))
    return tmp_path


def test_the_robot_of_a_file_is_that_of_its_data(folder: Path) -> None:
    robot = load_cell(folder / "cell.yaml").robot
    bundled = load_robot("ur10e")
    assert robot.name == "my_arm"
    assert np.array_equal(robot.joint_origin, bundled.joint_origin)
    assert robot.marks == bundled.marks


def test_a_cell_with_its_robot_comes_back_from_its_text(folder: Path) -> None:
    cell = load_cell(folder / "cell.yaml")
    text = cell_to_yaml(cell)
    again = cell_from_yaml(text)
    assert again.robot.name == "my_arm"
    assert np.array_equal(again.robot.link_inertia, cell.robot.link_inertia)
    assert again.robot.marks == cell.robot.marks
    assert cell_to_yaml(again) == text
    assert cell_hash(again) == cell_hash(cell)


def test_comments_do_not_change_the_hash_but_figures_do(folder: Path) -> None:
    before = cell_hash(load_cell(folder / "cell.yaml"))
    file = folder / "own" / "arm.yaml"
    file.write_text("# a comment\n" + file.read_text())
    assert cell_hash(load_cell(folder / "cell.yaml")) == before
    file.write_text(file.read_text().replace("value: 10.0", "value: 11.0", 1))
    assert cell_hash(load_cell(folder / "cell.yaml")) != before


@pytest.mark.parametrize("name", ["../arm.yaml", "/etc/arm.yaml", "http://host/arm.yaml"])
def test_a_robot_elsewhere_is_refused(folder: Path, name: str) -> None:
    (folder / "cell.yaml").write_text(CELL.format(robot=f'"{name}"'))
    with pytest.raises(
        CellFileError, match=r"cell.yaml:3: robot: file .* must stand beside this file"
    ):
        load_cell(folder / "cell.yaml")


def test_a_link_that_leads_out_is_refused(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    outside = tmp_path_factory.mktemp("outside") / "arm.yaml"
    outside.write_text(TEXT)
    (folder / "own" / "linked.yaml").symlink_to(outside)
    (folder / "cell.yaml").write_text(CELL.format(robot="own/linked.yaml"))
    with pytest.raises(CellFileError, match="leads out of the folder"):
        load_cell(folder / "cell.yaml")


def test_a_text_cannot_name_a_file() -> None:
    with pytest.raises(CellFileError, match="can't be named in a text"):
        cell_from_yaml(CELL.format(robot="arm.yaml"))


def test_what_is_wrong_in_the_robot_file_is_said_with_its_line(folder: Path) -> None:
    file = folder / "own" / "arm.yaml"
    file.write_text(file.read_text().replace("names: [shoulder_pan_joint, ", "names: [", 1))
    with pytest.raises(CellFileError, match=r"arm.yaml:\d+: links has 7 entries, must have 6"):
        load_cell(folder / "cell.yaml")


def test_all_errors_of_a_robot_file_are_found_in_one_run(folder: Path) -> None:
    file = folder / "own" / "arm.yaml"
    text = file.read_text()
    text = re.sub(r"rated_payload_kg: \{value: [\d.]+", "rated_payload_kg: {value: -3", text)
    text = re.sub(r"com_m: \{value: \[", "com_m: {value: [1000, ", text, count=1)
    text = re.sub(r"radius: 0.095", "radius: 0", text)
    file.write_text(text)
    sentences = "\n".join(map(str, robot_file_errors(file)))
    assert "rated_payload_kg.value is -3 kg, must be in (0, 10000] kg" in sentences
    assert "com_m.value has 4 entries, must have 3" in sentences
    assert "radius is 0 m, must be in (0, 100] m" in sentences


def test_a_missing_robot_file_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="can't be opened"):
        robot_named(str(tmp_path / "nobody.yaml"))


def test_the_controller_of_a_robot_is_a_table_beside_it_or_what_is_known_without(
    folder: Path,
) -> None:
    file = folder / "own" / "arm.yaml"
    text = file.read_text()
    (folder / "own" / "mine.yaml").write_text(POWER.replace("name: kr_c4", "name: mine", 1))
    file.write_text(text.replace("controller: none", "controller: mine.yaml", 1))
    cell = load_cell(folder / "cell.yaml")
    assert cell.robot.controller.name == "mine"
    assert cell_from_yaml(cell_to_yaml(cell)).robot.controller == cell.robot.controller
    watts = "controller: {standing_w: {value: 120, source: measured, confidence: M}}"
    file.write_text(text.replace("controller: none", watts, 1))
    power = load_cell(folder / "cell.yaml").robot.controller
    assert not power.has_table
    assert [mode.controller_watts for mode in power.modes] == [120.0]


def test_a_pause_in_a_mode_that_the_controller_lacks_is_an_error(folder: Path) -> None:
    program = "program: [{pause: 60, power_mode: HIBERNATION}]\n"
    (folder / "cell.yaml").write_text(CELL.format(robot="own/arm.yaml") + program)
    findings = check_cell(load_cell(folder / "cell.yaml"))
    assert [finding.severity for finding in findings if "HIBERNATION" in finding.sentence] == [
        "error"
    ]
