"""Law: who stands at a limit, as an encoder reads it, can go on; an end is the goal asked for."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from ir_description.robot import LIMIT_TOLERANCE
from ir_msgs_py.options import PlanOptions
from ir_planner import MovementPlan, Planner, Reference, RequestError
from ir_planner.regional.regional import plan_to_configurations
from ir_planner.request import Context, Work

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of poses
from _pinocchio_arm import pinocchio_arm

CASES = [(seed, joint) for seed in range(3) for joint in range(6)]


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open")


def end_of(planner: Planner, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Where a planned movement ends (n,)."""
    plan = planner.plan_regional(start=start, goal=goal)
    assert plan.status.ok, plan.status
    return np.asarray(plan.trajectory.positions[-1])


@pytest.mark.sampled
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


def by_function(planner: Planner, start: np.ndarray, goal: np.ndarray) -> MovementPlan:
    """The library's own function, without the planner in front of it."""
    options = PlanOptions()
    work = Work(2000, np.inf, lambda: 0.0)
    context = Context.of(planner.scene(), options, work)
    return plan_to_configurations(start, goal, context, planner.settings.searches)


DOORS = {
    "function": by_function,
    "planner": lambda planner, start, goal: planner.plan_regional(
        start=start, goal=goal, max_iterations=2000
    ),
    "text": lambda planner, start, goal: planner.plan_regional(
        start=start,
        goal=" ".join(f"A{k + 1} {value!r}" for k, value in enumerate(np.degrees(goal).tolist())),
        max_iterations=2000,
    ),
    "points": lambda planner, start, goal: planner.plan_trajectory(
        Reference(np.array([start, goal]))
    ),
}


@pytest.mark.sampled
@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("seed", range(8))
def test_an_end_is_the_goal_that_was_asked_for(planner: Planner, door: str, seed: int) -> None:
    """Whether a goal lies within the limits or beyond, whatever it is asked through."""
    draw = np.random.default_rng([seed, 2])
    robot = planner.cell.robot
    home = np.array(robot.machine_home)
    goal = draw.uniform(1.2 * robot.position_min, 1.2 * robot.position_max)
    goal = np.where(draw.random(6) < 0.4, goal, home + draw.uniform(-0.3, 0.3, 6))
    beyond = (goal < robot.position_min) | (goal > robot.position_max)
    if beyond.any():
        with pytest.raises(RequestError, match="exceeded by"):
            DOORS[door](planner, home, goal)
        return
    plan = DOORS[door](planner, home, goal)
    if plan.status.ok:
        assert np.abs(plan.trajectory.positions[-1] - goal).max() <= 1e-9
        assert np.abs(plan.trajectory.positions[0] - home).max() <= 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_the_tool_ends_at_the_pose_that_was_asked_for(planner: Planner, seed: int) -> None:
    draw = np.random.default_rng([seed, 3])
    robot = planner.cell.robot
    home = np.array(robot.machine_home)
    there = np.clip(home + draw.uniform(-0.8, 0.8, 6), robot.position_min, robot.position_max)
    arm = pinocchio_arm(robot, (), planner.cell.base_pose)
    data = arm.createData()

    def pose_of(q: np.ndarray) -> np.ndarray:
        pinocchio.forwardKinematics(arm, data, q)
        flange = data.oMi[arm.njoints - 1].homogeneous
        return np.asarray(planner.cell.base_pose @ flange @ planner.cell.tcp)

    plan = planner.plan_regional(start=home, goal=pose_of(there), max_iterations=2000)
    if plan.status.ok:
        off = pose_of(plan.trajectory.positions[-1]) - pose_of(there)
        assert np.abs(off).max() <= 1e-9


@pytest.mark.parametrize("length", [0, 1, 5, 7])
def test_joint_values_of_a_wrong_length_are_one_kind_of_error(
    planner: Planner, length: int
) -> None:
    short = np.zeros(length)
    home = np.array(planner.cell.robot.machine_home)
    asked = (
        lambda: planner.plan_regional(goal=short),
        lambda: planner.plan_regional(start=short, goal="home"),
        lambda: by_function(planner, home, short),
        lambda: planner.check_state(short),
        lambda: planner.check_states(np.zeros((2, length))),
        lambda: planner.standby(10.0, q=short),
        lambda: planner.compute_ik(np.eye(4), near=short),
        lambda: planner.plan_program(start=short),
    )
    for ask in asked:
        with pytest.raises(RequestError, match=r"has shape \("):
            ask()
