"""Law: who stands at a limit, as an encoder reads it, can go on; an end is the goal asked for."""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import LIMIT_TOLERANCE
from ir_planner import Planner, RequestError

CASES = [(seed, joint) for seed in range(3) for joint in range(6)]


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open")


def end_of(planner: Planner, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Where a planned movement ends (n,)."""
    plan = planner.plan_regional(start=start, goal=goal)
    assert plan.status.ok, plan.status
    return np.asarray(plan.trajectory.positions[-1])


@pytest.mark.parametrize(("seed", "joint"), CASES)
def test_a_robot_that_stands_a_little_beyond_a_limit_drives_back_and_there(
    planner: Planner, seed: int, joint: int
) -> None:
    draw = np.random.default_rng([seed, joint])
    robot = planner.cell.robot
    home = np.array(robot.machine_home)
    beyond = home.copy()
    side = draw.choice([-1.0, 1.0])
    limit = (robot.position_max if side > 0.0 else robot.position_min)[joint]
    beyond[joint] = limit + side * draw.uniform(0.0, LIMIT_TOLERANCE)
    if not planner.check_state(q=np.clip(beyond, robot.position_min, robot.position_max)).valid:
        pytest.skip("the robot touches something there")
    assert end_of(planner, beyond, home) == pytest.approx(home, abs=1e-9)
    there = end_of(planner, home, beyond)
    assert there[joint] == pytest.approx(limit, abs=1e-9)
    assert np.delete(there, joint) == pytest.approx(np.delete(beyond, joint), abs=1e-9)


@pytest.mark.parametrize(("seed", "joint"), CASES)
def test_a_goal_beyond_a_limit_is_refused_with_its_excess(
    planner: Planner, seed: int, joint: int
) -> None:
    """Value and bound don't print alike without what lies between them."""
    draw = np.random.default_rng([seed, joint, 1])
    robot = planner.cell.robot
    goal = np.array(robot.machine_home)
    excess = 10.0 ** draw.uniform(np.log10(1.01 * LIMIT_TOLERANCE), 0.3)
    goal[joint] = robot.position_max[joint] + excess
    with pytest.raises(RequestError, match=rf"joint_a{joint + 1} is .* exceeded by "):
        planner.plan_regional(start=np.array(robot.machine_home), goal=goal)
