"""The torque that plans leave to the feedback: kept at every instant, said in every report, paid in
time.
"""

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner, PlannerSettings, Reference
from ir_planner.regional import MovementPlan
from ir_planner.request import Goal
from ir_planner.scene import MotionLimits

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge
from _drives import Drives

RESERVES = (0.0, 0.1, 0.3)


@cache
def movement(reserve: float) -> tuple[Planner, MovementPlan]:
    """The fastest movement of a task of the open cell."""
    planner = Planner(clock=lambda: 0.0, settings=PlannerSettings(torque_reserve=reserve))
    task = planner.set_cell("open").task("home->p1")
    goal = Goal(configuration=task.goal, text="p1")
    return planner, planner.plan_regional(
        start=task.start, goal=goal, options=PlanOptions(objective="time")
    )


@pytest.mark.parametrize("reserve", RESERVES)
def test_a_plan_leaves_its_reserve_at_every_instant(reserve: float) -> None:
    planner, plan = movement(reserve)
    assert plan.trajectory is not None
    assert plan.report.certified
    assert plan.report.torque_reserve == pytest.approx(reserve, abs=1e-6)
    dynamics = planner.scene().dynamics
    motion = plan.trajectory.sample(np.linspace(0.0, plan.trajectory.duration, 2000))
    torque = dynamics.inverse_dynamics(motion.q, motion.qd, motion.qdd)
    use = np.abs(torque / dynamics.torque_limit(motion.qd)).max()
    assert use <= 1.0 - reserve + 1e-6
    assert use > 0.85 * (1.0 - reserve)  # the reserve is what bounds the fastest movement here


def test_a_larger_reserve_takes_longer() -> None:
    durations = [movement(reserve)[1].report.duration for reserve in RESERVES]
    assert durations == sorted(durations)
    assert durations[-1] > 1.02 * durations[0]


def test_what_uses_the_reserve_is_no_violation_but_its_report_says_so() -> None:
    """The driver can follow it: the limit itself is kept."""
    fast = movement(0.0)[1].trajectory
    assert fast is not None
    found = movement(0.1)[0].evaluate(fast, safety_distance=0.02)
    assert found.verification.certified
    assert found.report.torque_reserve < 0.03


def test_scalings_keep_the_reserve() -> None:
    one = np.ones(6)
    limits = MotionLimits(one, one, one, torque_reserve=0.2).with_torque_share(0.9)
    for changed in (limits, limits.scaled(0.5, 0.5), limits.for_speed(1.0)):
        assert changed.torque_share == pytest.approx(0.9 * 0.8)
        assert changed.with_torque_share(1.0).torque_share == pytest.approx(0.8)
    assert replace(limits, torque_reserve=0.0).with_torque_share(0.9).torque_share == 0.9


@pytest.mark.parametrize("seed", range(6))
def test_the_rated_payload_is_moved_whatever_the_reserve(seed: int) -> None:
    """Wherever a slow movement needs less than the drives give; the answer says what is left."""
    draw = np.random.default_rng(seed)
    cell = load_cell("open")
    robot = cell.robot
    mass = draw.uniform(0.9, 1.0) * robot.rated_payload
    tool = replace(cell.tool, mass=mass, inertia=0.1 * mass * np.eye(3))
    planner = Planner(replace(cell, tool=tool), clock=lambda: 0.0)
    home = np.array(robot.machine_home)
    goal = home + draw.uniform(-0.5, 0.5, robot.n)
    line = home + np.linspace(0.0, 1.0, 50)[:, None] * (goal - home)
    scene = planner.scene()
    speed = np.broadcast_to(0.1 * np.sign(goal - home) * robot.velocity_max, line.shape)
    drives = Drives(scene)
    need = max(
        (np.abs(drives.torque(line, way * speed, 0.0 * line)) / drives.envelope(speed)).max()
        for way in (1.0, -1.0)
    )
    if need > 0.97 or not planner.check_state(goal).valid:
        pytest.skip("the drives can't, or the robot touches something")
    for plan in (
        planner.plan_regional(goal=goal),
        planner.plan_trajectory(Reference(np.array([home, goal]))),
    ):
        assert plan.status.ok, plan.status.message
        assert plan.report.certified
        eased = [stage.note for stage in plan.info.stages if stage.name == "torque reserve"]
        assert bool(eased) == (plan.report.torque_reserve < 0.1 - 1e-6)
        assert 1.0 - plan.report.torque_ratio.max() >= plan.report.torque_reserve - 1e-6


def test_around_an_obstacle_too_a_load_gets_as_much_of_the_reserve_as_it_needs() -> None:
    """Whether a load is too heavy doesn't depend on what lies on the straight movement."""
    cell = load_cell("table_columns")
    mass = cell.robot.rated_payload
    tool = replace(cell.tool, mass=mass, inertia=0.1 * mass * np.eye(3))
    settings = PlannerSettings(torque_reserve=0.5)
    planner = Planner(replace(cell, tool=tool), clock=lambda: 0.0, settings=settings)
    task = planner.set_cell(planner.cell).task("tL->tR")
    goal = Goal(configuration=task.goal, text="tR")
    plan = planner.plan_regional(
        start=task.start, goal=goal, options=PlanOptions(max_iterations=20_000)
    )
    assert plan.status.ok, plan.status.message
    assert plan.report.certified
    assert plan.waypoints is not None
    assert len(plan.waypoints) > 2  # the straight one is not free
    assert plan.report.torque_reserve < 0.5
    assert any(stage.name == "torque reserve" for stage in plan.info.stages)
