"""Programs of a robot on a rail: E1 written, read back and driven with the arm."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ir_description import cell_from_yaml
from ir_krl import Followed, KrlMotionError, parse
from ir_planner import Planner, ProgramPlan
from ir_planner.errors import RequestError
from ir_planner.krl import evaluate_krl, export_krl, follow_krl

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "rail_cell.yaml"
HOME = "{A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 0}"


@pytest.fixture(scope="module")
def railed() -> Planner:
    return Planner(cell_from_yaml(EXAMPLE.read_text()), clock=lambda: 0.0)


@pytest.fixture(scope="module")
def plan(railed: Planner) -> ProgramPlan:
    """From where the robot is parked into the press, which is farther along the rail."""
    found = railed.plan_program(stations=("press_place",), start=railed.cell.posture("park"))
    assert found.status.ok, found.status
    return found


def program(railed: Planner, *lines: str) -> Followed:
    body = "\n".join(("PTP " + HOME, *lines))
    return follow_krl(railed, [parse(f"DEF T( )\n{body}\nEND\n", "t.src")])


def last(railed: Planner, *lines: str) -> np.ndarray:
    """Where (7,) the last motion of a program ends."""
    found = evaluate_krl(railed, program(railed, *lines))
    moved = [one for one in found.steps if one.step.moves]
    return np.asarray(moved[-1].step.trajectory.positions[-1])


def test_an_exported_program_comes_back_with_its_joules(railed: Planner, plan: ProgramPlan) -> None:
    export = export_krl(railed, plan.movements, "along")
    assert export.exported.certified
    assert export.exported.energy == pytest.approx(export.planned.energy, rel=0.02)
    points = re.findall(r"E6AXIS XM\d+_\d+={A1 .*?,A6 [-.\d]+,E1 ([-.\d]+)}", export.data)
    assert max(map(float, points)) > 3000.0  # mm
    sources = [parse(export.source, "along.src"), parse(export.data, "along.dat")]
    again = evaluate_krl(railed, follow_krl(railed, sources))
    assert again.certified
    assert again.report.energy == pytest.approx(export.joules, rel=0.005)


def test_a_ptp_moves_the_rail_in_millimetres(railed: Planner) -> None:
    end = last(railed, "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 3500}")
    np.testing.assert_allclose(end, [3.5, 0, *np.radians([-90, 90]), 0, 0, 0], atol=1e-9)


def test_an_axis_motion_without_e1_leaves_the_rail_where_it_is(railed: Planner) -> None:
    end = last(railed, "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 500}", "PTP {A1 20}")
    assert end[0] == pytest.approx(0.5)
    assert end[1] == pytest.approx(np.radians(20.0))


def test_a_relative_motion_moves_the_rail_on(railed: Planner) -> None:
    end = last(railed, "PTP_REL {A1 5,E1 250}", "PTP_REL {A1 5,E1 250}")
    assert end[0] == pytest.approx(0.5)
    assert end[1] == pytest.approx(np.radians(10.0))


def test_a_frame_is_reached_from_the_place_of_the_rail_that_it_names(railed: Planner) -> None:
    """Frames count from the robot's foot where E1 is 0, as a robot root that E1 moves has it."""
    pose = railed.cell.station("press_place").pose
    foot = railed.cell.base_pose
    x, y, z = 1e3 * (pose[:3, 3] - foot[:3, 3])
    frame = f"{{X {x:.3f},Y {y:.3f},Z {z + 200:.3f},A 0,B 180,C 0,E1 4500}}"
    end = last(railed, "$TOOL=$NULLFRAME", f"PTP {frame}")
    assert end[0] == pytest.approx(4.5)
    flange = railed.scene().chain.link_poses(end[None])[0, -1]
    np.testing.assert_allclose(flange[:3, 3], pose[:3, 3] + [0, 0, 0.2], rtol=0.0, atol=2e-6)


def test_a_place_beyond_the_travel_is_refused(railed: Planner) -> None:
    with pytest.raises(KrlMotionError, match="E1 6 m is not within 0 to 5 m"):
        evaluate_krl(railed, program(railed, "PTP {A1 0,E1 6000}"))


def test_a_language_without_rails_is_refused(railed: Planner, plan: ProgramPlan) -> None:
    with pytest.raises(RequestError, match="urscript moves no rail"):
        export_krl(railed, plan.movements, "along", style="urscript")


def test_without_a_rail_e1_is_part_of_the_cell_as_before(planner: Planner) -> None:
    lines = f"PTP {HOME}\nPTP {{A1 10,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 100}}"
    followed = follow_krl(planner, [parse(f"DEF T( )\n{lines}\nEND\n", "t.src")])
    assert any("external axes aren't modelled" in note.text for note in followed.notes)
