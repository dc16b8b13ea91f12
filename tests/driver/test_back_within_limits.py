"""Law: a robot that stands beyond a limit is driven back in, never farther out; from elsewhere no
trajectory leads beyond a limit.
"""

from __future__ import annotations

import numpy as np
import pytest

from ir_description.robot import OUTSIDE_MAX
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ExecutionSettings, PathMotion, check_trajectory, checked_route

SETTINGS = ExecutionSettings()


@pytest.fixture(scope="module")
def dynamics(cell):
    return DynamicsModel(cell.robot, (), cell.base_pose)


def still(q):
    return PathMotion(q, np.zeros(6), np.zeros(6))


def drawn(cell, seed):
    """A configuration within the limits, and the same with one joint beyond one of its own."""
    draw = np.random.default_rng(seed)
    robot = cell.robot
    inside = np.array(robot.machine_home)
    joint = int(draw.choice([0, 3, 5]))
    side = draw.choice([-1.0, 1.0])
    limit = robot.position_max[joint] if side > 0.0 else robot.position_min[joint]
    inside[joint] = limit - side * 0.05
    beyond = inside.copy()
    beyond[joint] = limit + side * draw.uniform(1e-3, 0.99 * OUTSIDE_MAX)
    return joint, side, inside, beyond


@pytest.mark.parametrize("seed", range(12))
def test_the_way_back_is_driven_where_the_robot_stands_there_and_nowhere_else(
    cell, dynamics, plan, seed
):
    joint, side, inside, beyond = drawn(cell, seed)
    back = plan(8.0, beyond, inside)
    executed, _ = check_trajectory(back, cell.robot, dynamics, SETTINGS)
    route = checked_route(executed, still(beyond), cell.robot, dynamics, SETTINGS)
    times = np.linspace(0.0, float(route.path.durations.sum()), 200)
    driven = np.array([route.path.position(time)[joint] for time in times])
    assert (side * (beyond[joint] - driven) >= -1e-9).all()
    later = plan([3.0, 11.0], beyond, inside)
    for q in (inside, beyond - 0.5 * (beyond - inside)):
        with pytest.raises(TrajectoryRefusedError, match=r"from the commanded|the limit is"):
            checked_route(executed, still(q), cell.robot, dynamics, SETTINGS)
        with pytest.raises(TrajectoryRefusedError, match="the limit is"):
            checked_route(later, still(q), cell.robot, dynamics, SETTINGS)


@pytest.mark.parametrize("seed", range(12))
def test_nothing_leads_farther_out_ends_outside_or_begins_too_far(cell, dynamics, plan, seed):
    joint, side, inside, beyond = drawn(cell, seed)
    farther = beyond.copy()
    farther[joint] += side * 0.01
    far = inside.copy()
    far[joint] += side * (0.06 + OUTSIDE_MAX)
    for trajectory in (
        plan([0.0, 4.0, 12.0], beyond, farther, inside),
        plan(8.0, beyond, beyond),
        plan(8.0, inside, beyond),
        plan(8.0, far, inside),
        plan([0.0, 8.0, 16.0], inside, beyond, inside),
    ):
        with pytest.raises(TrajectoryRefusedError, match="limit"):
            check_trajectory(trajectory, cell.robot, dynamics, SETTINGS)


def test_an_overshoot_between_points_that_lead_back_is_refused(cell, dynamics, plan):
    """Points alone don't show it: the spline that begins outwards does."""
    joint, side, inside, beyond = drawn(cell, 3)
    trajectory = plan(8.0, beyond, inside)
    velocities = np.array(trajectory.velocities)
    velocities[0, joint] = side * 0.05
    outwards = type(trajectory)(
        trajectory.joint_names, trajectory.times_ns, trajectory.positions, velocities, None
    )
    with pytest.raises(TrajectoryRefusedError, match="the limit is"):
        check_trajectory(outwards, cell.robot, dynamics, SETTINGS)
