"""A robot on a rail is driven: by the ideal backend and by PyBullet, whose bodies are judges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ir_description import Cell, cell_from_yaml
from ir_kernels import Chain, DynamicsModel
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_sim_driver.controller.simulation import Simulation, make_simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.goal import ErrorCode, GoalOutcome, TrajectoryGoal
from ir_sim_driver.plant.plants import plant_named
from ir_sim_driver.plant.pybullet_backend import PyBulletBackend

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "rail_cell.yaml"
AWAY = "E1 3.5 A1 20 A2 -100 A3 100 A4 10 A5 20 A6 0"
PREDICTED = 0.005  # of the joules: what steps of 2 ms and the servo's error leave
SINGLE = 2e-5  # m: Bullet turns frames in single precision


@pytest.fixture(scope="module")
def cell() -> Cell:
    return cell_from_yaml(EXAMPLE.read_text())


@pytest.fixture(scope="module")
def planner(cell: Cell) -> Planner:
    return Planner(cell, clock=lambda: 0.0)


def driven(simulation: Simulation, trajectory: JointTrajectory) -> GoalOutcome:
    simulation.execute(simulation.vet(TrajectoryGoal(trajectory), 0), 0)
    for _ in range(20_000):
        simulation.step()
        outcomes = simulation.take_outcomes()
        if outcomes:
            return outcomes[-1]
    raise AssertionError("the movement did not end")


@pytest.mark.parametrize("backend", ["ideal", "pybullet"])
def test_a_planned_movement_is_driven_with_the_planned_joules(
    cell: Cell, planner: Planner, backend: str
) -> None:
    plan = planner.plan_regional(start="home", goal=AWAY)
    assert plan.trajectory is not None
    simulation = make_simulation(cell, backend=backend)
    outcome = driven(simulation, plan.trajectory)
    assert outcome.code == ErrorCode.SUCCESSFUL, outcome.sentence
    assert len(outcome.max_tracking_error) == 7
    assert outcome.contact is None
    assert outcome.energy == pytest.approx(plan.report.energy, rel=PREDICTED)
    np.testing.assert_allclose(
        simulation.backend.q, plan.trajectory.positions[-1], rtol=0.0, atol=1e-6
    )


def test_bullet_agrees_on_torques_masses_and_places(cell: Cell) -> None:
    robot = cell.robot
    plant = plant_named("nominal", robot, robot.controller)
    backend = PyBulletBackend(plant, robot, 0.002, cell.base_pose)
    assert cell.tool is not None
    backend.set_load((cell.tool,))
    dynamics = DynamicsModel(robot, (cell.tool,), cell.base_pose)
    chain = Chain(robot, cell.base_pose)
    rng = np.random.default_rng(4)
    for q in rng.uniform(robot.position_min, robot.position_max, (10, 7)):
        qd, qdd = rng.normal(size=(2, 7))
        backend.reset(q)
        arm = np.array(backend._arm.inverse_dynamics(q.tolist(), qd.tolist(), qdd.tolist()))
        bias = dynamics.bias(q[None], qd[None])[0]
        H = dynamics.mass_matrix(q[None])[0]
        expected = bias + H @ qdd
        np.testing.assert_allclose(arm, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())
        theirs = backend.mass_matrix()
        np.testing.assert_allclose(theirs, H, rtol=0.0, atol=1e-9 * np.abs(H).max())
        poses = chain.link_poses(q[None])[0]
        for link in range(1, 7):
            com = poses[link, :3, :3] @ robot.link_com[link] + poses[link, :3, 3]
            assert np.abs(backend.link_com_position(link) - com).max() < SINGLE


def test_a_trajectory_off_the_rail_is_refused_in_metres(cell: Cell) -> None:
    q = np.array([cell.machine_home, cell.machine_home])
    q[1, 0] = 6.0
    rest = np.zeros_like(q)
    trajectory = JointTrajectory.from_seconds(
        cell.robot.joint_names, np.array([0.0, 10.0]), q, rest, rest
    )
    with pytest.raises(TrajectoryRefusedError, match=r"E1\) is at 6.000000 m"):
        make_simulation(cell, backend="ideal").vet(TrajectoryGoal(trajectory), 0)


@pytest.mark.parametrize("seed", [0, 7])
def test_a_drawn_plant_on_a_rail_drives_what_is_planned(
    seed: int, cell: Cell, planner: Planner
) -> None:
    plan = planner.plan_regional(start="home", goal=AWAY)
    assert plan.trajectory is not None
    simulation = make_simulation(cell, plant=f"typical:{seed}")
    outcome = driven(simulation, plan.trajectory)
    assert outcome.code == ErrorCode.SUCCESSFUL, outcome.sentence
