"""Laws: along LIN, CIRC and SPLINE the tool draws in the cell what the program says, wherever E1
takes the robot meanwhile, and E1 moves evenly with the tool's way; what is written with E1 is read
back and certified.

Judge: Pinocchio's forward kinematics with a prismatic joint.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from ir_description import Cell, cell_from_yaml, robot_urdf
from ir_description.poses import composed
from ir_krl import Followed, KrlMotionError, parse
from ir_krl.errors import KrlRunError
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.krl import evaluate_krl, export_krl, follow_krl
from ir_values.arrays import FloatArray

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "rail_cell.yaml"
ON_PATH = 2e-5  # m, of the spline of the axes between samples 4 mm apart
SEEDS = range(6)


@pytest.fixture(scope="module")
def cell() -> Cell:
    return cell_from_yaml(EXAMPLE.read_text())


@pytest.fixture(scope="module")
def railed(cell: Cell) -> Planner:
    return Planner(cell, clock=lambda: 0.0)


@pytest.fixture(scope="module")
def tools(cell: Cell) -> Callable[[FloatArray], FloatArray]:
    """Poses (M, 4, 4) of the tcp in the cell at q (M, 7)."""
    model = pinocchio.buildModelFromXML(robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose))
    data = model.createData()

    def poses(q: FloatArray) -> FloatArray:
        found = []
        for row in q:
            pinocchio.framesForwardKinematics(model, data, row)
            found.append(data.oMf[model.getFrameId("tcp")].homogeneous.copy())
        return np.array(found)

    return poses


def followed(railed: Planner, *lines: str, at: float = 2500.0) -> Followed:
    begin = f"PTP {{A1 0,A2 -90,A3 95,A4 0,A5 60,A6 0,E1 {at}}}"
    body = "\n".join((begin, *lines))
    return follow_krl(railed, [parse(f"DEF T( )\n{body}\nEND\n", "t.src")])


def driven(railed: Planner, *lines: str, at: float = 2500.0) -> list[JointTrajectory]:
    """The movements from standstill to standstill after the first PTP."""
    found = evaluate_krl(railed, followed(railed, "PTP_REL {A6 0.1}", *lines, at=at))
    return [one.step.trajectory for one in found.steps if one.step.moves][1:]


def sampled(trajectory: JointTrajectory) -> FloatArray:
    return np.asarray(trajectory.sample(np.linspace(0.0, trajectory.duration, 401)).q)


def off_line(places: FloatArray, end: FloatArray) -> float:
    """How far (M, 3) places are off the line from the first of them to `end` (3,)."""
    along = (end - places[0]) / np.linalg.norm(end - places[0])
    away = places - places[0]
    return float(np.linalg.norm(away - (away @ along)[:, None] * along, axis=1).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_a_lin_is_straight_in_the_cell_and_e1_moves_evenly_with_it(
    railed: Planner, tools: Callable[[FloatArray], FloatArray], seed: int
) -> None:
    draw = np.random.default_rng([seed, 71])
    x, y, z = draw.uniform(-250.0, 250.0, 3)
    slid = draw.uniform(-500.0, 500.0)
    turned = draw.uniform(-20.0, 20.0)
    (line,) = driven(railed, f"LIN_REL {{X {x},Y {y},Z {z},B {turned},E1 {slid}}}")
    q = sampled(line)
    poses = tools(q)
    end = poses[0, :3, 3] + 1e-3 * np.array([x, y, z])
    np.testing.assert_allclose(poses[-1, :3, 3], end, rtol=0.0, atol=ON_PATH)
    assert off_line(poses[:, :3, 3], end) < ON_PATH
    way = np.linalg.norm(poses[:, :3, 3] - poses[0, :3, 3], axis=1)
    np.testing.assert_allclose(q[:, 0], 2.5 + 1e-3 * slid * way / way[-1], rtol=0.0, atol=ON_PATH)
    turn = pinocchio.log3(poses[0, :3, :3].T @ poses[-1, :3, :3])
    assert np.linalg.norm(turn) == pytest.approx(abs(np.radians(turned)), abs=1e-6)


def test_a_lin_that_names_no_e1_is_that_of_the_arm_which_stands_there(
    railed: Planner, cell: Cell
) -> None:
    text = EXAMPLE.read_text()
    start = text.index("rail:\n")
    text = text.replace(text[start : text.index("base_contacts:")], "")
    for name in ("home_deg: [", "park_deg: ["):
        text = text.replace(f"{name}0, ", name)
    moved = np.eye(4)
    moved[:3, 3] = [0.0, 1.5, 0.0]
    there = cell_from_yaml(text.replace(", [carriage, bed]", ""))
    arm = Planner(replace(there, base_pose=composed(moved, there.base_pose)), clock=lambda: 0.0)
    lines = ("$VEL.CP=0.4", "LIN_REL {X -120,Z 90}", "CIRC_REL {X 60,Y 80},{X 0,Y 160}")
    on_rail = driven(railed, *lines, at=1500.0)
    alone = driven(arm, *lines)
    for one, other in zip(on_rail, alone, strict=True):
        np.testing.assert_allclose(one.positions[:, 0], 1.5, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(one.positions[:, 1:], other.positions, rtol=0.0, atol=1e-9)
        assert one.duration == pytest.approx(other.duration, abs=2e-3)


def test_the_tool_stands_while_e1_alone_moves(
    railed: Planner, tools: Callable[[FloatArray], FloatArray]
) -> None:
    (line,) = driven(railed, "LIN_REL {E1 -600}")
    q = sampled(line)
    assert q[-1, 0] == pytest.approx(1.9, abs=1e-9)
    poses = tools(q)
    np.testing.assert_allclose(poses, np.tile(poses[0], (len(q), 1, 1)), rtol=0.0, atol=ON_PATH)


@pytest.mark.parametrize("word", ["CIRC", "SCIRC"])
def test_a_circle_is_round_in_the_cell(
    railed: Planner, tools: Callable[[FloatArray], FloatArray], word: str
) -> None:
    line = f"{word}_REL {{X 150,Y 150}},{{X 0,Y 300,E1 400}}"
    (circle,) = driven(railed, line)
    q = sampled(circle)
    places = tools(q)[:, :3, 3]
    centre = places[0] + [0.0, 0.15, 0.0]
    np.testing.assert_allclose(
        np.linalg.norm(places - centre, axis=1), 0.15, rtol=0.0, atol=ON_PATH
    )
    assert q[-1, 0] == pytest.approx(2.9, abs=1e-9)


def test_a_place_of_the_rail_that_only_an_auxiliary_point_names_is_noted(railed: Planner) -> None:
    said = "E1 of the auxiliary point isn't passed: it moves evenly to that of the end"
    points = "{X 150,Y 150,E1 900},{X 0,Y 300,E1 400}"
    begin = ("PTP_REL {A6 0.1}",)
    for word, noted in (("SCIRC_REL", 1), ("CIRC_REL", 0)):  # CIRC ignores it by itself
        found = evaluate_krl(railed, followed(railed, *begin, f"{word} {points}"))
        assert [note.text for note in found.notes].count(said) == noted


def test_a_spline_passes_its_points_with_the_rail_where_they_say(
    railed: Planner, tools: Callable[[FloatArray], FloatArray]
) -> None:
    steps = [(100.0, 150.0, 0.0, 200.0), (50.0, 150.0, -80.0, 100.0), (-60.0, 120.0, 40.0, 0.0)]
    begin = tools(driven(railed, "LIN_REL {X 1}")[0].positions[:1])[0, :3, 3]
    at = np.array([*1e3 * (begin - railed.cell.base_pose[:3, 3]), 2500.0])
    ends = at + np.cumsum(steps, axis=0)
    parts = [f"SPL {{X {x},Y {y},Z {z},E1 {e}}}" for x, y, z, e in ends]
    (spline,) = driven(railed, "SPLINE", *parts, "ENDSPLINE")
    q = np.asarray(spline.sample(np.linspace(0.0, spline.duration, 20_001)).q)
    places = tools(q[::10])[:, :3, 3]
    wanted = places[0].copy()
    rail = 2.5
    for x, y, z, slid in steps:
        wanted += 1e-3 * np.array([x, y, z])
        rail += 1e-3 * slid
        k = int(np.linalg.norm(places - wanted, axis=1).argmin())
        np.testing.assert_allclose(places[k], wanted, rtol=0.0, atol=1e-3)  # between samples
        assert q[10 * k, 0] == pytest.approx(rail, abs=1e-3)


def test_a_spline_that_takes_e1_beyond_its_travel_is_refused(railed: Planner) -> None:
    with pytest.raises(KrlMotionError, match=r"E1 5\.2 m is not within 0 to 5 m"):
        driven(railed, "LIN_REL {Y 100,E1 2700}")
    with pytest.raises(KrlMotionError, match=r"E1 5\.2 m is not within 0 to 5 m"):
        driven(railed, "SPLINE", "SPL {Y 3000,E1 5200}", "ENDSPLINE")
    # between points the spline swings out
    parts = ("SPL {Y 4000,E1 4999}", "SPL {Y 4010,E1 5000}", "SPL {Y 4200,E1 5000}")
    with pytest.raises(KrlMotionError, match=r"E1 5\.\d+ m is not within 0 to 5 m"):
        driven(railed, "SPLINE", *parts, "ENDSPLINE", at=3800.0)


def test_a_path_out_of_the_arms_reach_where_e1_takes_it_is_refused(railed: Planner) -> None:
    with pytest.raises(KrlMotionError, match="leaves the reach or an axis limit"):
        driven(railed, "LIN_REL {Y -300,E1 2400}", at=2500.0)


def test_e1_keeps_the_shares_of_its_own_speed(railed: Planner, cell: Cell) -> None:
    away = "PTP {E6AXIS: E1 4500}"
    (full,) = driven(railed, away, at=500.0)
    (slow,) = driven(railed, "$VEL_EXTAX[1]=25", away, at=500.0)
    rail = cell.robot.velocity_max[0]
    assert full.velocities is not None
    assert slow.velocities is not None
    assert 0.9 * rail < np.abs(full.velocities[:, 0]).max() <= rail
    assert np.abs(slow.velocities[:, 0]).max() == pytest.approx(0.25 * rail, rel=1e-3)
    (formed,) = driven(railed, "BAS(#VEL_PTP,25)", away, at=500.0)
    assert formed.duration == pytest.approx(slow.duration, rel=1e-6)
    (eased,) = driven(railed, "$ACC_EXTAX[1]=10", away, at=500.0)
    assert eased.accelerations is not None
    most = 0.1 * cell.robot.acceleration_max[0]
    assert np.abs(eased.accelerations[:, 0]).max() <= most * (1.0 + 1e-9)
    (line,) = driven(railed, "$VEL_EXTAX[1]=25", "LIN_REL {E1 -800}")
    assert line.velocities is not None
    assert np.abs(line.velocities[:, 0]).max() <= 0.25 * rail * (1.0 + 1e-6)


def test_what_is_assumed_of_its_speed_is_said(railed: Planner) -> None:
    said = "$VEL_EXTAX or $ACC_EXTAX isn't set: E1 has all of its speed"
    assert said in [note.text for note in followed(railed, "PTP_REL {E6AXIS: E1 100}").notes]
    named = followed(railed, "BAS(#INITMOV,0)", "PTP_REL {E6AXIS: E1 100}")
    count = [note.place.line for note in named.notes if note.text == said]
    assert count in ([], [2])  # of the PTP before BAS alone


def test_a_stored_place_keeps_its_e1(railed: Planner) -> None:
    program = followed(
        railed,
        "DECL E6POS HERE",
        "LIN_REL {X -50,E1 100}",
        "HERE=$POS_ACT",
        "PTP {A1 10,E1 1000}",
        "PTP HERE",
        "LIN_REL {Z 50,E1 10}",
        "HERE=$POS_ACT",
        "PTP {A1 10,E1 1000}",
        "PTP HERE",
    )
    found = [one.step.trajectory for one in evaluate_krl(railed, program).steps if one.step.moves]
    ends = [float(each.positions[-1, 0]) for each in found]
    assert ends == pytest.approx([2.6, 1.0, 2.6, 2.61, 1.0, 2.61], abs=1e-9)


def test_a_frame_is_reached_as_from_where_the_rail_already_stands(
    railed: Planner, tools: Callable[[FloatArray], FloatArray]
) -> None:
    """A position without S and T: E1's way counts nothing beside the turns of the axes."""
    (there,) = driven(railed, "PTP_REL {E6AXIS: E1 4400}", at=500.0)
    x, y, z = 1e3 * (tools(there.positions[-1:])[0, :3, 3] - railed.cell.base_pose[:3, 3])
    frame = f"PTP {{X {x},Y {y},Z {z},E1 4900}}"
    draw = np.random.default_rng(72)
    for sign in (1.0, -1.0, -1.0):
        wrist = draw.uniform([-60.0, 40.0, -170.0], [60.0, 80.0, 170.0]) * [1.0, sign, 1.0]
        arm = f"PTP {{A4 {wrist[0]},A5 {wrist[1]},A6 {wrist[2]},E1 "
        near, far = (driven(railed, f"{arm}{e1}}}", frame)[-1] for e1 in (4900, 100))
        np.testing.assert_allclose(far.positions[-1], near.positions[-1], rtol=0.0, atol=1e-9)


def test_e1_alone_says_not_whether_the_arm_rides_along(railed: Planner) -> None:
    with pytest.raises(KrlRunError, match=r"PTP to E1 alone: \{E6AXIS: E1 …\} leaves A1 to A6"):
        driven(railed, "PTP {E1 100}")
    (rides,) = driven(railed, "PTP {E6AXIS: E1 100}")
    assert (rides.positions[:, 1:] == rides.positions[0, 1:]).all()


# Written and read back.


@pytest.mark.parametrize("style", ["kss8", pytest.param("krc2", marks=pytest.mark.sampled)])
def test_inline_forms_take_e1_with_them(railed: Planner, style: str) -> None:
    plan = railed.plan_program(
        stations=("press_place",), start=railed.cell.posture("park"), max_iterations=3_000
    )
    assert plan.status.ok, plan.status
    export = export_krl(railed, plan.movements, "along", style=style)
    assert export.exported.certified
    places = re.findall(r"DECL E6(?:POS|AXIS) XP\d+={.*?,E1 ([-.\d]+),E2 0.0", export.data)
    assert max(map(float, places)) > 3000.0  # mm
    ends = [
        step.trajectory.positions[-1]
        for step in plan.movements
        if step.kind != MovementKind.PAUSE and step.trajectory is not None
    ]
    again = [step.trajectory.positions[-1] for step in export.steps if step.trajectory is not None]
    for one, other in zip(ends, again, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-5)
    sources = [parse(export.source, "along.src"), parse(export.data, "along.dat")]
    back = evaluate_krl(railed, follow_krl(railed, sources))
    assert back.certified
    assert back.report.energy == pytest.approx(export.joules, rel=0.005)
    assert "E1 carries the robot" in export.source


def test_a_path_of_the_tool_is_written_with_the_place_of_the_rail(
    railed: Planner, tools: Callable[[FloatArray], FloatArray]
) -> None:
    start = np.array([[0, 0, 1, 2.2], [0, 1, 0, -0.5], [-1, 0, 0, 1.1], [0, 0, 0, 1.0]], float)
    end = start.copy()
    end[1, 3] = -0.2
    path = CartesianPath(start, (CartesianSegment("line", (end,)),), tool_speed=0.1)
    plan = railed.plan_cartesian(path)
    assert plan.trajectory is not None
    step = PlannedMovement(
        kind=MovementKind.CARTESIAN,
        trajectory_id=plan.trajectory.trajectory_id,
        trajectory=plan.trajectory,
        report=plan.report,
        duration=plan.report.duration,
        load="gripper",
    )
    export = export_krl(railed, [step], "seam")
    rail = 1e3 * plan.trajectory.positions[0, 0]
    written = re.findall(r"DECL E6POS XM1_\d+={.*?,E1 ([-.\d]+)}", export.data)
    assert written
    assert [float(each) for each in written] == pytest.approx([rail] * len(written), abs=1e-5)
    assert export.exported.certified
    (again,) = (each.trajectory for each in export.steps)
    assert again is not None
    places = tools(sampled(again))[:, :3, 3]
    assert off_line(places, end[:3, 3]) < 1.2e-4
