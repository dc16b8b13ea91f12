"""The contract of a robot's data, from kinematics to a driven movement, for each bundled robot."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio
import pytest

from ir_description import (
    CellFileError,
    RobotModel,
    bundled_robots,
    cell_from_yaml,
    load_robot,
    robot_urdf,
)
from ir_kernels import Chain, DynamicsModel, inverse_kinematics
from ir_planner import Planner, parse_goal
from ir_sim_driver.controller.simulation import make_simulation
from ir_sim_driver.motion.goal import TrajectoryGoal

POSITION = 1e-9  # m
TORQUE = 1e-6  # Nm; sums of thousands of Nm in another order
GRAVITY = 9.80665
COUNT = 30
CELL = """
format: ir_cell/1
name: empty
robot: {name}
"""


@pytest.fixture(params=bundled_robots())
def robot(request: pytest.FixtureRequest) -> RobotModel:
    return load_robot(request.param)


def configurations(robot: RobotModel) -> np.ndarray:
    """Random configurations (COUNT, n) within the joint range."""
    generator = np.random.default_rng(1)
    return generator.uniform(robot.position_min, robot.position_max, (COUNT, robot.n))


def test_pinocchio_reads_its_urdf_and_agrees_on_kinematics_and_dynamics(robot: RobotModel) -> None:
    model = pinocchio.buildModelFromXML(robot_urdf(robot))
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    data = model.createData()
    dynamics = DynamicsModel(robot)
    chain = Chain(robot)
    assert list(model.names)[1:] == list(robot.joint_names)
    q = configurations(robot)
    for k, bias in enumerate(dynamics.bias(q, np.ones_like(q))):
        expected = pinocchio.rnea(model, data, q[k], np.ones(robot.n), np.zeros(robot.n))
        assert np.abs(bias - expected).max() < TORQUE
        pinocchio.framesForwardKinematics(model, data, q[k])
        last = data.oMf[model.getFrameId(robot.link_names[-1])].homogeneous
        assert np.abs(chain.link_poses(q[k : k + 1])[0, -1] - last).max() < POSITION


def test_the_inverse_kinematics_finds_every_configuration_from_its_pose(robot: RobotModel) -> None:
    chain = Chain(robot)
    solver = inverse_kinematics(chain, robot.position_min, robot.position_max)
    q = configurations(robot)
    solutions = solver.solve(chain.tcp_poses(q))
    for k, one in enumerate(q):
        found = solutions.of_pose(k)
        reached = chain.tcp_poses(found)
        assert np.abs(reached - chain.tcp_poses(one[None])).max() < 1e-6
        assert np.abs(found - one).max(axis=1).min() < 1e-6


def test_it_stands_free_at_machine_home_and_holds_itself_there(robot: RobotModel) -> None:
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    planner.set_cell(text=CELL.format(name=robot.name))
    state = planner.check_state(np.array(robot.machine_home), safety_distance=0.02, max_pairs=1)
    assert state.valid
    home = robot.machine_home[None]
    still = np.zeros_like(home)
    dynamics = DynamicsModel(robot)
    assert (
        np.abs(dynamics.inverse_dynamics(home, still, still)) < dynamics.torque_limit(still)
    ).all()


def test_a_movement_is_planned_certified_and_driven_at_the_planned_energy(
    robot: RobotModel,
) -> None:
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    cell = planner.set_cell(text=CELL.format(name=robot.name))
    home = np.array(robot.machine_home)
    there = np.degrees(home) + np.array([30.0, 10.0, -10.0, 20.0, -20.0, 30.0])
    goal = parse_goal(" ".join(f"A{k} {angle:.6f}" for k, angle in enumerate(there, start=1)), cell)
    plan = planner.plan_regional(start=home, goal=goal)
    assert plan.status.ok, plan.status.message
    assert plan.report.certified
    assert plan.trajectory is not None
    simulation = make_simulation(cell, "none", "ideal")
    simulation.execute(simulation.vet(TrajectoryGoal(plan.trajectory), 0), 0)
    outcomes = []
    for _ in range(round((plan.report.duration + 5.0) / simulation.settings.dt)):
        simulation.step()
        outcomes += simulation.take_outcomes()
        if outcomes:
            break
    assert outcomes[0].code == 0, outcomes[0].sentence
    assert outcomes[0].energy == pytest.approx(plan.report.energy, rel=0.01, abs=10.0)


def test_a_cell_without_a_known_robot_lists_the_known_ones() -> None:
    with pytest.raises(CellFileError, match=", ".join(bundled_robots())):
        cell_from_yaml(CELL.format(name="scara"))
