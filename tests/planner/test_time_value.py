"""The price of a second follows from the robot, and no default plan costs more than the straight
movement in its own time, on every robot.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from ir_description import bundled_robots, load_robot
from ir_msgs_py.options import ROBOTS_TIME_VALUE, PlanOptions
from ir_planner import Goal, Planner
from ir_planner.request import Context, Work
from ir_planner.timing import baseline
from ir_values.errors import InvalidValueError

BENCHES = ("kr6_bench", "ur10e_bench", "kr300_pallets", "open")


def test_a_second_is_worth_500_w_for_the_kr_210_and_less_for_smaller_ones() -> None:
    price = {name: load_robot(name).time_value for name in bundled_robots()}
    assert price["kr210_r2700_extra"] == 500.0
    assert 0.0 < price["ur10e"] < price["kr6_r900_2"] < 60.0
    assert 500.0 < price["kr300_r2700_2"] < 600.0


def test_it_scales_with_the_torques_of_the_drives() -> None:
    robot = load_robot("kr6_r900_2")
    stronger = replace(robot, envelope_torque=3.0 * robot.envelope_torque)
    assert stronger.time_value == pytest.approx(3.0 * robot.time_value, rel=0.05)


def test_who_names_no_price_gets_the_robots_and_zero_is_a_value() -> None:
    assert PlanOptions().time_value == ROBOTS_TIME_VALUE
    assert PlanOptions(time_value=0.0).time_value == 0.0
    with pytest.raises(InvalidValueError, match="time_value is -2 W"):
        PlanOptions(time_value=-2.0)


@pytest.mark.parametrize("cell", BENCHES)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_default_plan_costs_no_more_than_ptp_in_its_own_time(cell: str, seed: int) -> None:
    planner = Planner(cell, clock=itertools.repeat(0.0).__next__)
    scene = planner.scene("none")
    robot = scene.cell.robot
    home = np.array(scene.cell.park)
    drawn = home + np.random.default_rng(seed).uniform(-0.6, 0.6, (50, robot.n))
    drawn = np.clip(drawn, robot.position_min, robot.position_max)
    there = drawn[np.argmax(planner.check_states(drawn, load="none").valid)]
    options = PlanOptions(load="none")
    plan = planner.plan_regional(start=home, goal=Goal(configuration=there), options=options)
    assert plan.status.ok, plan.status.message
    timed = replace(options, duration=plan.report.duration)
    work = Work(100_000, 1.0, lambda: 0.0)
    ptp = baseline(home, there, Context.of(scene, timed, work))
    if ptp is not None:  # as fast as that
        assert plan.report.energy <= ptp.report.energy * (1.0 + 1e-3)
