"""`ir new`: tables and tool are placed until the program plans, whatever the wrist is like."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from ir_cli.new_cell import USUAL, cell_text, layouts, planned_text
from ir_description import RobotModel, load_robot
from ir_description.files import read_cell
from ir_planner import Planner


def thick_wrist(robot: RobotModel, more: float) -> RobotModel:
    """The robot with thicker capsules of its fourth link [m]; its own pairs are left out."""
    capsules = tuple(
        replace(each, radius=each.radius + more) if each.link == 4 else each
        for each in robot.capsules
    )
    return replace(robot, capsules=capsules, self_pairs=())


def test_the_usual_layout_is_tried_first_and_none_twice() -> None:
    assert layouts()[0] == USUAL
    assert len(set(layouts())) == len(layouts())


@pytest.mark.parametrize("more", [0.0, 0.12])
def test_the_program_plans(more: float, tmp_path: Path) -> None:
    robot = thick_wrist(load_robot("kr210_r2700_extra"), more)
    text, lacking = planned_text(tmp_path / "cell.yaml", "kr210_r2700_extra", robot)
    assert lacking == ""
    assert (text == cell_text("cell", "kr210_r2700_extra", robot)) == (more == 0.0)
    planner = Planner()
    planner.set_cell(read_cell(text, "cell.yaml", lambda _: robot, tmp_path))
    assert planner.plan_program().status.ok


@pytest.mark.long
def test_what_lacks_is_told_where_no_layout_plans(tmp_path: Path) -> None:
    robot = thick_wrist(load_robot("kr210_r2700_extra"), 1.0)
    text, lacking = planned_text(tmp_path / "cell.yaml", "kr210_r2700_extra", robot)
    assert "gripper_body" in lacking
    assert text == cell_text("cell", "kr210_r2700_extra", robot)
