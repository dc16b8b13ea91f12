"""Movements of a robot on a rail: against the same arm that stands there, and by Pinocchio."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from ir_description import Cell, cell_from_yaml, robot_urdf
from ir_description.poses import composed
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.errors import RequestError
from ir_values.arrays import FloatArray

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "rail_cell.yaml"
AWAY = "E1 3.5 A1 20 A2 -100 A3 100 A4 10 A5 20 A6 0"
ROUNDED = 1e-9  # relative: coordinates of bodies are taken from another origin


@pytest.fixture(scope="module")
def cell() -> Cell:
    return cell_from_yaml(EXAMPLE.read_text())


@pytest.fixture(scope="module")
def planner(cell: Cell) -> Planner:
    return Planner(cell, clock=lambda: 0.0)


def standing(cell: Cell, place: float) -> Cell:
    """The cell without the rail, the arm on its carriage at a place [m] of it."""
    text = EXAMPLE.read_text()
    start = text.index("rail:\n")
    rail = text[start : text.index("base_contacts:")]
    text = text.replace(rail, "").replace(", [carriage, bed]", "")
    for name in ("home_deg: [", "park_deg: ["):
        text = text.replace(f"{name}0, ", name)
    moved = cell.base_pose.copy()
    moved[:3, 3] += place * cell.base_pose[:3, :3] @ np.array([0.0, 1.0, 0.0])
    return replace(cell_from_yaml(text), base_pose=moved)


def alone(trajectory: JointTrajectory) -> JointTrajectory:
    """The arm's part of a trajectory."""
    assert trajectory.velocities is not None
    assert trajectory.accelerations is not None
    return JointTrajectory(
        trajectory.joint_names[1:],
        trajectory.times_ns,
        trajectory.positions[:, 1:],
        trajectory.velocities[:, 1:],
        trajectory.accelerations[:, 1:],
    )


@pytest.mark.parametrize("place", [0.0, 1.7, 5.0])
def test_a_rail_at_rest_costs_and_keeps_what_the_arm_that_stands_there_does(
    cell: Cell, planner: Planner, place: float
) -> None:
    goal = f"E1 {place} A1 -60 A2 -100 A3 110 A4 20 A5 30 A6 -40"
    start = np.append(place, cell.park[1:])
    plan = planner.plan_regional(start=start, goal=goal)
    assert plan.status.ok, plan.status
    assert plan.trajectory is not None
    still = plan.trajectory.positions.copy()
    still[:, 0] = place
    speed, change = (
        np.array(x) for x in (plan.trajectory.velocities, plan.trajectory.accelerations)
    )
    speed[:, 0] = change[:, 0] = 0.0
    railed = JointTrajectory(
        plan.trajectory.joint_names, plan.trajectory.times_ns, still, speed, change
    )
    here = planner.evaluate(trajectory=railed).report
    arm = Planner(standing(cell, place), clock=lambda: 0.0)
    there = arm.evaluate(trajectory=alone(railed)).report
    assert here.certified
    assert there.certified
    np.testing.assert_allclose(here.joint_energy[1:], there.joint_energy, rtol=1e-7, atol=1e-6)
    # the drive of the rail holds the carriage against the arm: copper losses, and nothing else
    samples = railed.sample(np.linspace(0.0, here.duration, 20001))
    force = planner.scene().dynamics.inverse_dynamics(samples.q, samples.qd, samples.qdd)[:, 0]
    robot = cell.robot
    lost = robot.copper_loss[0] * np.square(force / robot.gear_ratio[0])
    joules = float(np.trapezoid(lost, dx=here.duration / 20000))
    assert here.joint_energy[0] == pytest.approx(joules, rel=1e-3)
    assert there.energy <= here.energy <= there.energy + joules + 1e-6
    np.testing.assert_allclose(here.torque_ratio[1:], there.torque_ratio, rtol=1e-9)
    assert here.min_clearance == pytest.approx(there.min_clearance, abs=2e-4)


def test_moving_cell_and_rail_together_changes_nothing(cell: Cell, planner: Planner) -> None:
    plan = planner.plan_regional(start="park", goal=AWAY)
    assert plan.trajectory is not None
    turn = np.eye(4)
    turn[:2, :2] = [[0.6, -0.8], [0.8, 0.6]]
    turn[:3, 3] = [3.0, -2.0, 0.0]
    moved = replace(cell, base_pose=composed(turn, cell.base_pose))
    for machine in cell.equipment:
        moved = moved.with_equipment(machine.name, composed(turn, machine.pose))
    there = Planner(moved, clock=lambda: 0.0).evaluate(trajectory=plan.trajectory).report
    assert there.certified
    assert there.energy == pytest.approx(plan.report.energy, rel=ROUNDED)
    assert there.min_clearance == pytest.approx(plan.report.min_clearance, abs=2e-4)
    assert there.tool_speed == pytest.approx(plan.report.tool_speed, rel=1e-6)


def goals() -> Iterator[str]:
    yield AWAY
    yield "pallet_pick"
    yield "press_place"
    yield "press_place E1 4.25"


@pytest.mark.parametrize("goal", goals())
def test_a_movement_ends_where_it_was_asked_to_and_its_certificate_holds(
    cell: Cell, planner: Planner, goal: str
) -> None:
    plan = planner.plan_regional(start="park", goal=goal)
    assert plan.status.ok, plan.status
    assert plan.trajectory is not None
    end = plan.trajectory.positions[-1]
    if goal == AWAY:
        assert np.allclose(end[1:], np.radians([20, -100, 100, 10, 20, 0]), rtol=0.0, atol=1e-12)
        assert end[0] == 3.5
    else:
        model = pinocchio.buildModelFromXML(
            robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose)
        )
        data = model.createData()
        pinocchio.framesForwardKinematics(model, data, end)
        pose = data.oMf[model.getFrameId("tcp")].homogeneous
        wanted = cell.station(goal.split()[0]).pose
        np.testing.assert_allclose(pose, wanted, rtol=0.0, atol=1e-8)
    if "E1" in goal:
        assert end[0] == float(goal.split()[goal.split().index("E1") + 1])
    scene = planner.scene()
    samples = plan.trajectory.sample(np.linspace(0.0, plan.report.duration, 2000))
    robot = cell.robot
    assert (np.abs(samples.qd) <= robot.velocity_max * (1 + 1e-6)).all()
    assert (np.abs(samples.qdd) <= robot.acceleration_max * (1 + 1e-6)).all()
    least = scene.collision.distances(samples.q) - scene.thresholds(0.0)
    assert least.min() >= plan.report.min_clearance - 1e-6
    torque = scene.dynamics.inverse_dynamics(samples.q, samples.qd, samples.qdd)
    use = np.abs(torque) / scene.dynamics.torque_limit(samples.qd)
    assert (use.max(axis=0) <= plan.report.torque_ratio + 1e-6).all()
    speed = tool_speeds(planner, samples.q, samples.qd)
    assert speed.max() <= plan.report.tool_speed + 1e-9


def tool_speeds(planner: Planner, q: FloatArray, qd: FloatArray) -> FloatArray:
    J = planner.scene().chain.jacobian(q)[:, :3]
    return np.asarray(np.linalg.norm(np.einsum("kij,kj->ki", J, qd), axis=1))


@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_bounds_of_the_tool_hold_on_the_rail(planner: Planner, speed: float) -> None:
    plan = planner.plan_regional(start="park", goal=AWAY, tool_speed=speed)
    assert plan.status.ok, plan.status
    assert plan.trajectory is not None
    samples = plan.trajectory.sample(np.linspace(0.0, plan.report.duration, 3000))
    assert tool_speeds(planner, samples.q, samples.qd).max() <= speed
    assert plan.report.tool_speed <= speed


def test_energy_is_the_work_of_the_drives_and_their_losses(cell: Cell, planner: Planner) -> None:
    plan = planner.plan_regional(start="park", goal=AWAY)
    assert plan.trajectory is not None
    samples = plan.trajectory.sample(np.linspace(0.0, plan.report.duration, 20001))
    dynamics = planner.scene().dynamics
    power = dynamics.drive_power(samples.q, samples.qd, samples.qdd)
    joules = np.trapezoid(power, dx=plan.report.duration / 20000, axis=0)
    np.testing.assert_allclose(plan.report.joint_energy, joules, rtol=1e-3, atol=0.5)
    assert plan.report.energy == pytest.approx(
        plan.report.joint_energy.sum() + plan.report.base_energy, rel=2e-2
    )


@pytest.mark.parametrize("station", ["pallet_pick", "press_place"])
def test_a_service_movement_begins_at_the_station_and_leaves_it(
    cell: Cell, planner: Planner, station: str
) -> None:
    plan = planner.plan_service(station=station)
    assert plan.status.ok, plan.status
    for candidate in plan.candidates:
        assert candidate.report.certified
        q = candidate.trajectory.positions[[0, -1]]
        first, last = planner.scene().chain.tcp_poses(np.ascontiguousarray(q))
        np.testing.assert_allclose(first, cell.station(station).pose, rtol=0.0, atol=1e-8)
        assert last[2, 3] > first[2, 3] + 0.03


def test_a_program_along_the_rail_is_certified(planner: Planner) -> None:
    plan = planner.plan_program(max_iterations=3_000)
    assert plan.status.ok, plan.status
    assert plan.report.certified


def test_a_path_of_the_tool_is_driven_within_its_error(planner: Planner) -> None:
    start = np.array([[0, 0, 1, 2.2], [0, 1, 0, -0.5], [-1, 0, 0, 1.1], [0, 0, 0, 1.0]], float)
    end = start.copy()
    end[1, 3] = -0.2
    path = CartesianPath(start, (CartesianSegment("line", (end,)),), tool_speed=0.1)
    plan = planner.plan_cartesian(path)
    assert plan.status.ok, plan.status
    assert plan.trajectory is not None
    samples = plan.trajectory.sample(np.linspace(0.0, plan.report.duration, 500))
    places = planner.scene().chain.tcp_poses(samples.q)[:, :3, 3]
    assert np.abs(places[:, [0, 2]] - start[[0, 2], 3]).max() <= plan.tool_error + 1e-9


@pytest.mark.parametrize(
    ("goal", "sentence"),
    [
        ("E1 7 A1 0 A2 -90 A3 90 A4 0 A5 0 A6 0", r"E1 is 7 m: it must be in \[0, 5\] m"),
        ("press_place E1 -1", r"E1 is -1 m: it must be in \[0, 5\] m"),
        ("A1 0 A2 -90 A3 90 A4 0 A5 0 A6 0", "each of E1 A1"),
        ("press_place E1 x", "finite number"),
    ],
)
def test_goals_off_the_rail_are_refused(planner: Planner, goal: str, sentence: str) -> None:
    with pytest.raises(RequestError, match=sentence):
        planner.plan_regional(start="park", goal=goal)


def test_a_station_that_one_place_of_the_rail_does_not_reach_is_no_goal(planner: Planner) -> None:
    plan = planner.plan_regional(start="park", goal="press_place E1 0")
    assert not plan.status.ok
    assert "can't be reached" in plan.status.message


def test_coordinate_descent_says_that_it_turns_joints(planner: Planner) -> None:
    with pytest.raises(RequestError, match="E1 slides"):
        planner.compute_ik(goal="press_place", method="ccd")


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (AWAY.replace("E1 3.5", "E1 nan"), "E1 is 'nan': it must be a finite number m"),
        (AWAY.replace("A1 20", "A1 x"), "A1 is 'x': it must be a finite number deg"),
        ("press_place E1 2500", "E1 is 2500 m: it must be in [0, 5] m"),
    ],
)
def test_a_goal_on_a_rail_is_refused_in_the_unit_of_each_axis(
    planner: Planner, goal: str, said: str
) -> None:
    with pytest.raises(RequestError, match=re.escape(said)):
        planner.plan_regional(start="park", goal=goal)
