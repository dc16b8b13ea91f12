"""Where the drives barely hold the robot: what was certified is started from every side, and
followed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from ir_description import load_cell, robot_urdf
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.controller.simulation import make_simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import (
    ErrorCode,
    ExecutionSettings,
    PathMotion,
    check_trajectory,
    checked_route,
)

SETTINGS = ExecutionSettings()
SATURATED = 0.3  # s that a motor may give all it has
HELD = [0.93, 0.97, 0.99, 0.9999]
SIGNS = [np.array([1.0 if k >> j & 1 else -1.0 for j in range(6)]) for k in range(64)]
STRETCHED = np.radians([10.0, -60.0, 40.0, 20.0, 30.0, 0.0])


@pytest.fixture(scope="module")
def bare():
    """The cell, and the load that the robot has at its flange."""
    cell = load_cell("open")
    return cell, (cell.tool,)


def weak(bare, share, friction=0.0):
    """Robot and dynamics whose joint_a3 needs this share of its torque to stand stretched;
    friction: share of joint_a3's Coulomb friction that is counted in.
    """
    cell, loads = bare
    zero = np.zeros((1, 6))
    holding = DynamicsModel(cell.robot, loads, cell.base_pose).inverse_dynamics(
        STRETCHED[None], zero, zero
    )
    torque = np.array(cell.robot.envelope_torque)
    needed = abs(holding[0, 2]) + friction * cell.robot.friction_coulomb[2]
    torque[2] = needed / share
    robot = replace(cell.robot, envelope_torque=torque)
    return robot, DynamicsModel(robot, loads, cell.base_pose)


def still(q):
    return PathMotion(q, np.zeros(6), np.zeros(6))


def turned(joint, by=0.1):
    q = STRETCHED.copy()
    q[joint] += by
    return q


@pytest.mark.sampled
@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize("size", [1e-11, 1e-9, 1e-6, 9e-6])
def test_a_joint_that_may_rest_where_friction_is_too_much_for_it_does_not_keep_others_from_moving(
    bare, plan, held, size
):
    robot, dynamics = weak(bare, held)
    for trajectory in (plan(1.0, STRETCHED, STRETCHED), plan(2.0, STRETCHED, turned(0))):
        check_trajectory(trajectory, robot, dynamics, SETTINGS)
        for signs in SIGNS[::5]:
            route = checked_route(
                trajectory, still(STRETCHED + size * signs), robot, dynamics, SETTINGS
            )
            assert route.lead == 1
            assert route.offset < SATURATED
            assert np.abs(route.path.position(route.offset) - STRETCHED).max() < 1e-12


def test_a_difference_that_the_drives_cant_close_is_refused_with_what_to_do(bare, plan):
    robot, dynamics = weak(bare, 0.97)
    trajectory = plan(2.0, STRETCHED, turned(0))
    check_trajectory(trajectory, robot, dynamics, SETTINGS)
    with pytest.raises(
        TrajectoryRefusedError, match=r"joint_a3 needs .*plan it again from where it stands"
    ):
        checked_route(trajectory, still(STRETCHED + 0.005), robot, dynamics, SETTINGS)


@pytest.mark.parametrize("size", [1e-9, 1e-5, 5e-4])
def test_what_moves_every_joint_at_the_edge_is_reached_within_the_torques(bare, plan, size):
    """Friction is in its own proof already: what is left for closing is the slack."""
    robot, dynamics = weak(bare, 0.9999, friction=1.0)
    trajectory = plan(60.0, STRETCHED, STRETCHED + np.array([0.1, -0.02, -0.02, 0.1, 0.02, 0.1]))
    check_trajectory(trajectory, robot, dynamics, SETTINGS)
    for signs in SIGNS[::5]:
        route = checked_route(
            trajectory, still(STRETCHED + size * signs), robot, dynamics, SETTINGS
        )
        share = torque_share(route, robot, bare[1], bare[0], dynamics)
        assert share.max() <= 1.0 + SETTINGS.limit_slack


def torque_share(route, robot, loads, cell, dynamics):
    """Largest share of every joint's torque in what leads in, by Pinocchio: (6,)."""
    model = pinocchio.buildModelFromXML(robot_urdf(robot, loads, cell.tcp))
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    data = model.createData()
    T = float(route.path.durations[: route.lead].sum())
    motions = [route.path.motion(s) for s in np.linspace(0.0, T, 200)[1:-1]]
    q, qd, qdd = (np.array(rows) for rows in zip(*motions, strict=True))
    arm = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    friction = robot.friction_viscous * qd + robot.friction_coulomb * np.sign(qd)
    total = arm + robot.reflected_inertia * qdd + friction - dynamics.counterbalance(q)
    return np.abs(total / dynamics.torque_limit(qd)).max(axis=0)


@pytest.mark.parametrize("seed", range(3))
def test_every_kind_of_lead_in_keeps_the_torques_by_a_second_opinion(bare, plan, seed):
    """Closing, leading in until a first time above 0, and bridging in motion."""
    cell, loads = bare
    robot = cell.robot
    rng = np.random.default_rng(seed)
    dynamics = DynamicsModel(robot, loads, cell.base_pose)
    low = robot.position_min + 0.6
    high = robot.position_max - 0.6
    seen = set()
    for _ in range(20):
        q = low + rng.random(6) * (high - low)
        there = q + rng.uniform(-0.5, 0.5, 6)
        moving = PathMotion(q, 0.02 * rng.normal(size=6), 0.02 * rng.normal(size=6))
        cases = {
            "closing": (plan(4.0, q, there), still(q + 0.0099 * rng.uniform(-1.0, 1.0, 6))),
            "leading": (plan([rng.uniform(0.3, 2.0), 5.0], there, q), moving),
            "bridging": (plan([0.0, rng.uniform(0.3, 2.0), 5.0], q, there, q), moving),
        }
        for kind, (trajectory, now) in cases.items():
            try:
                check_trajectory(trajectory, robot, dynamics, SETTINGS)
                route = checked_route(trajectory, now, robot, dynamics, SETTINGS)
            except TrajectoryRefusedError:
                assert kind != "closing" or torque_share_at(dynamics, q) > 1.0
                continue
            assert (
                torque_share(route, robot, loads, cell, dynamics).max()
                <= 1.0 + SETTINGS.limit_slack
            )
            seen.add(kind)
    assert seen == {"closing", "leading", "bridging"}


def torque_share_at(dynamics, q):
    zero = np.zeros((1, 6))
    return float(
        (np.abs(dynamics.inverse_dynamics(q[None], zero, zero)) / dynamics.torque_limit(zero)).max()
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_drives_that_barely_hold_follow_what_was_accepted(bare, plan, start, run_out, sign):
    robot, _ = weak(bare, 0.99)
    simulation = make_simulation(replace(bare[0], robot=robot), "cell", "pybullet")
    simulation.backend.reset(STRETCHED + sign * 9e-6)
    simulation.executor.hold(simulation.backend.q)
    start(simulation, plan(1.0, STRETCHED, turned(0, 0.03)))
    outcome = run_out(simulation)
    assert outcome.code is ErrorCode.SUCCESSFUL
    assert outcome.max_tool_deviation < 1e-4
    assert simulation.fault == ""
