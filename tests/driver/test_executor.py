"""Execution as a table of sample times; scaling, hold, stop and replacement keep path and
limits.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_kernels.chain import Chain
from ir_msgs_py.modes import Mode
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.controller.outputs import report
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.controller.simulation import make_simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.goal import ErrorCode, ExecutionSettings, JointTolerance
from ir_sim_driver.notices import Level

EXACT = 1e-9  # rad; the ideal robot is where it was commanded
DT = 0.001


@pytest.fixture
def home(cell):
    return np.array(cell.machine_home)


@pytest.fixture
def there(home):
    return home + np.array([0.8, 0.3, -0.3, 0.5, -0.4, 0.6])


def positions(simulation, seconds):
    """Positions (K, 6) after each step."""
    rows = []
    for _ in range(round(seconds / DT)):
        simulation.step()
        rows.append(simulation.backend.q.copy())
    return np.array(rows)


def distance_from_path(q, path):
    """Largest distance [rad] of rows q (K, 6) from a densely sampled path (M, 6)."""
    return max(np.abs(path - row).max(axis=1).min() for row in q)


@pytest.mark.parametrize("at", [0.001, 0.25, 0.5, 0.999, 1.0, 1.3, 1.999, 2.0])
def test_the_robot_is_where_the_interpolant_is(make, plan, start, home, there, at):
    trajectory = plan([0.0, 1.0, 2.0], home, home + 0.4 * (there - home), there)
    simulation = make()
    start(simulation, trajectory)
    simulation.run(at)
    assert np.abs(simulation.backend.q - trajectory.sample([at]).q[0]).max() < EXACT


def test_a_goal_ends_when_its_trajectory_does(make, plan, start, run_out, home, there):
    simulation = make()
    goal_id = start(simulation, plan(2.0, home, there))
    outcome = run_out(simulation)
    assert (outcome.goal_id, outcome.code, outcome.canceled) == (
        goal_id,
        ErrorCode.SUCCESSFUL,
        False,
    )
    assert simulation.steps == pytest.approx(2000, abs=2)
    assert outcome.energy > 0.0


def test_a_first_time_above_zero_leads_in_from_where_the_robot_is(
    make, plan, start, run_out, home, there
):
    simulation = make()
    trajectory = plan([2.0, 4.0], there, home)
    start(simulation, trajectory)
    q = positions(simulation, 2.0)
    assert np.abs(q[-1] - there).max() < EXACT
    speeds = np.diff(q, axis=0) / DT
    assert np.abs(speeds[0]).max() < 0.01
    assert np.abs(speeds[-1]).max() < 0.01
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL


def test_one_point_is_a_movement_and_one_at_zero_is_where_the_robot_is(
    make, plan, start, run_out, home, there
):
    simulation = make()
    start(simulation, plan([2.0], there))
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL
    assert np.abs(simulation.backend.q - there).max() < EXACT
    start(simulation, plan([0.0], there))
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL


def test_a_small_difference_at_the_start_is_closed_before_path_time_runs(
    make, plan, start, run_out, home, there
):
    simulation = make()
    start(simulation, plan(2.0, home + 0.009, there))
    assert simulation.executor.path_time < 0.0
    q = positions(simulation, 0.5)
    assert (
        np.abs(np.diff(q, 2, axis=0)).max() / DT**2 < 4.5
    )  # no jump: within the acceleration limits
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL


@pytest.mark.parametrize("factor", [0.5, 0.25])
def test_speed_scaling_stretches_time_and_keeps_the_path(
    make, plan, start, run_out, home, there, factor
):
    simulation = make()
    trajectory = plan(2.0, home, there)
    simulation.set_speed_scaling(factor)
    start(simulation, trajectory)
    q = positions(simulation, 2.0)
    assert distance_from_path(q[::50], trajectory.sample(np.linspace(0, 2, 4001)).q) < 1e-3
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL
    assert simulation.time == pytest.approx(2.0 / factor, abs=0.01)


def test_scaling_zero_holds_on_the_path_and_one_goes_on(make, plan, start, run_out, home, there):
    simulation = make()
    trajectory = plan(2.0, home, there)
    start(simulation, trajectory)
    simulation.run(1.0)
    simulation.set_speed_scaling(0.0)
    simulation.run(1.0)
    held = simulation.backend.q.copy()
    simulation.run(1.0)
    assert np.abs(simulation.backend.q - held).max() == 0.0
    assert distance_from_path([held], trajectory.sample(np.linspace(0, 2, 8001)).q) < 1e-3
    simulation.set_speed_scaling(7.0)
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL
    assert np.abs(simulation.backend.q - there).max() < EXACT


def test_move_enable_0_holds_too(make, plan, start, home, there):
    simulation = make()
    start(simulation, plan(2.0, home, there))
    simulation.run(1.0)
    simulation.plc.set_bit("move_enable", False)
    simulation.run(1.0)
    assert simulation.executor.path_speed == 0.0
    assert simulation.executor.active
    executor = report(simulation, 0.0)[2]
    assert (executor.level, executor.sentence.endswith("move_enable is 0")) == (Level.WARN, True)


@pytest.mark.parametrize("factor", [float("nan"), -1.0])
def test_a_speed_scaling_that_means_nothing_is_ignored_with_a_warning(make, factor):
    simulation = make()
    assert simulation.set_speed_scaling(factor) == 1.0
    assert "speed scaling" in simulation.notices.last.sentence


@settings(max_examples=6, deadline=None)
@given(at=st.floats(0.0, 2.0), backend=st.sampled_from(["ideal", "pybullet"]))
def test_a_cancel_at_any_instant_stops_on_the_path_within_the_limits(
    make, plan, start, cell, at, backend
):
    home = np.array(cell.machine_home)
    there = home + np.array([0.8, 0.3, -0.3, 0.5, -0.4, 0.6])
    simulation = make(backend)
    trajectory = plan(2.0, home, there)
    goal_id = start(simulation, trajectory)
    simulation.run(at)
    running = simulation.executor.active
    assert simulation.cancel(goal_id) == running
    q = positions(simulation, 1.0)
    outcomes = simulation.take_outcomes()
    assert len(outcomes) == 1
    assert outcomes[0].canceled == running
    assert outcomes[0].max_tool_deviation < 0.002
    assert distance_from_path(q[::100], trajectory.sample(np.linspace(0, 2, 4001)).q) < 1e-3
    acceleration = np.diff(q, 2, axis=0) / DT**2
    ripple = 0.05 if backend == "ideal" else 1.0  # encoders have steps
    assert (np.abs(acceleration) < 1.05 * cell.robot.acceleration_max + ripple).all()
    assert np.abs(q[-1] - q[-2]).max() < (EXACT if backend == "ideal" else 1e-7)
    assert not simulation.cancel(goal_id)


def test_stopping_twice_and_after_the_end_is_harmless(make, plan, start, run_out, home, there):
    simulation = make()
    goal_id = start(simulation, plan(2.0, home, there))
    simulation.run(1.0)
    assert simulation.cancel(goal_id)
    assert simulation.cancel(goal_id)
    assert run_out(simulation).canceled
    assert not simulation.cancel(goal_id)
    assert not simulation.cancel(12345)


@settings(max_examples=6, deadline=None)
@given(at=st.floats(0.05, 1.9), lead=st.floats(1.5, 3.0))
def test_a_replacement_never_jumps(make, plan, start, cell, at, lead):
    home = np.array(cell.machine_home)
    there = home + np.array([0.5, 0.2, -0.2, 0.3, -0.2, 0.4])
    simulation = make()
    start(simulation, plan(2.0, home, there))
    before = positions(simulation, at)
    start(simulation, plan([lead, lead + 1.0], home, home))
    after = positions(simulation, lead + 1.1)
    q = np.vstack((before, after))
    acceleration = np.abs(np.diff(q, 2, axis=0)) / DT**2
    assert (acceleration < 1.05 * cell.robot.acceleration_max + 0.05).all()
    first, second = simulation.take_outcomes()
    assert (first.code, "preempted" in first.sentence) == (ErrorCode.INVALID_GOAL, True)
    assert second.code == ErrorCode.SUCCESSFUL


def test_a_canceled_goal_that_is_replaced_before_it_stands_says_so(make, plan, start, home, there):
    simulation = make()
    goal_id = start(simulation, plan(2.0, home, there))
    simulation.run(1.0)
    simulation.cancel(goal_id)
    simulation.run(0.05)
    assert simulation.executor.path_speed > 0.1
    start(simulation, plan([2.0, 3.0], home, home))
    (outcome,) = simulation.take_outcomes()
    assert outcome.canceled
    assert outcome.sentence == "canceled; another trajectory took over before the robot stood"


def test_a_hundred_replacements_a_second_end_each_goal_once(make, plan, start, home):
    simulation = make()
    ids = []
    for k in range(100):
        ids.append(start(simulation, plan([1.5], home + 0.02 * (k % 3))))
        simulation.run(0.01)
    simulation.run(1.6)
    outcomes = simulation.take_outcomes()
    assert [outcome.goal_id for outcome in outcomes] == ids
    assert [outcome.code for outcome in outcomes] == [ErrorCode.INVALID_GOAL] * 99 + [
        ErrorCode.SUCCESSFUL
    ]


BOUND = np.array([600.0, 600.0, 600.0, 100.0, 100.0, 100.0])  # Nm, of docs/driver.md


@pytest.mark.sampled
@pytest.mark.parametrize("load", ["none", "gripper"])
@pytest.mark.parametrize("seed", range(3))
def test_up_to_the_bound_a_disturbed_tool_stays_within_two_millimetres(load, seed, start, run_out):
    simulation = make_simulation("demo", load, "pybullet")
    home = np.array(simulation.cell.machine_home)
    generator = np.random.default_rng(seed)
    target = home + np.array([0.6, 0.2, -0.2, 0.4, 0.3, 0.5])
    rest = np.zeros((2, 6))
    names = simulation.robot.joint_names
    start(simulation, JointTrajectory.from_seconds(names, [0.0, 1.6], [home, target], rest, rest))
    outcomes = []
    while not outcomes:
        simulation.disturb(BOUND * generator.choice([-1.0, 1.0], 6))
        simulation.run(float(generator.choice([0.005, 0.03, 0.2])))
        outcomes = simulation.take_outcomes()
    assert outcomes[0].code == ErrorCode.SUCCESSFUL
    assert outcomes[0].max_tool_deviation < 0.001


def test_a_robot_that_leaves_the_tube_is_stopped_by_the_brakes(
    make, plan, start, run_out, home, there, cell
):
    simulation = make("pybullet")
    start(simulation, plan(2.0, home, there))
    simulation.run(0.9)
    simulation.disturb(np.array([2e4, 0.0, 0.0, 0.0, 0.0, 0.0]))
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.PATH_TOLERANCE_VIOLATED
    assert "mm" in outcome.sentence
    assert "joint_a1" in outcome.sentence
    assert not simulation.executor.active
    simulation.disturb(None)
    simulation.run(0.5)
    assert simulation.modes.mode is Mode.EMERGENCY_STOP
    assert not simulation.backend.qd.any()


def test_a_path_tolerance_names_the_joint_and_the_amount(make, plan, start, run_out, home, there):
    simulation = make("pybullet", execution=ExecutionSettings(tube=0.1))
    tight = (JointTolerance("joint_a3", position=1e-5),)
    start(simulation, plan(2.0, home, there), path_tolerance=tight)
    simulation.run(0.5)
    simulation.disturb(np.array([0.0, 0.0, 900.0, 0.0, 0.0, 0.0]))
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.PATH_TOLERANCE_VIOLATED
    assert "joint_a3 position error" in outcome.sentence


def test_an_unreached_goal_tolerance_ends_after_the_goal_time(
    make, plan, start, run_out, home, there
):
    simulation = make("pybullet")
    tight = [
        JointTolerance(f"joint_a{i}", position=1e-9) for i in range(1, 7)
    ]  # finer than encoders
    start(simulation, plan(2.0, home, there), goal_tolerance=tight, goal_time=0.3)
    simulation.run(1.9)
    simulation.disturb(np.array([300.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.GOAL_TOLERANCE_VIOLATED
    assert simulation.time == pytest.approx(2.3, abs=0.01)


def test_tolerances_and_a_goal_time_of_0_are_the_settings(make, plan, start, run_out, home, there):
    zero = [JointTolerance(f"joint_a{i}", position=0.0) for i in range(1, 7)]
    tight = make("pybullet", execution=ExecutionSettings(tube=0.1, path_tolerance=1e-5))
    start(tight, plan(2.0, home, there), path_tolerance=zero)
    tight.run(0.5)
    tight.disturb(np.array([0.0, 0.0, 900.0, 0.0, 0.0, 0.0]))
    assert run_out(tight).code == ErrorCode.PATH_TOLERANCE_VIOLATED
    usual = make("pybullet")
    start(usual, plan(2.0, home, there), goal_tolerance=zero)
    assert run_out(usual).code == ErrorCode.SUCCESSFUL
    unreached = make("pybullet", execution=ExecutionSettings(goal_time=0.3))
    finest = [replace(one, position=1e-9) for one in zero]  # finer than encoders
    start(unreached, plan(2.0, home, there), goal_tolerance=finest, goal_time=0.0)
    unreached.run(1.9)
    unreached.disturb(np.array([300.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert run_out(unreached).code == ErrorCode.GOAL_TOLERANCE_VIOLATED
    assert unreached.time == pytest.approx(2.3, abs=0.01)


def test_a_stamp_in_the_near_future_waits(make, plan, start, home, there):
    simulation = make()
    start(simulation, plan(2.0, home, there), now_ns=5_000_000_000, stamp_ns=5_500_000_000)
    simulation.run(0.49)
    assert np.abs(simulation.backend.q - home).max() == 0.0
    simulation.run(2.02)
    assert simulation.take_outcomes()[0].code == ErrorCode.SUCCESSFUL


def test_a_goal_opens_the_brakes_and_waits_for_them(make, plan, start, run_out, home, there):
    from ir_sim_driver.controller.settings import ControllerSettings

    simulation = make(controller=ControllerSettings(start_mode="STAND_ON_BRAKES"))
    start(simulation, plan(2.0, home, there))
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL
    assert simulation.time == pytest.approx(1.0 + 0.7 + 2.0, abs=0.01)


def test_a_goal_that_is_canceled_before_it_moves_says_so(make, plan, start, run_out, home, there):
    simulation = make()
    goal_id = start(simulation, plan(2.0, home, there))
    simulation.cancel(goal_id)
    outcome = run_out(simulation)
    assert outcome.canceled
    assert outcome.sentence == "canceled; it had not begun to move"
    assert np.abs(simulation.backend.q - home).max() < EXACT


def test_an_error_beyond_a_tiny_tolerance_is_told_with_digits_that_show_it(
    make, plan, start, run_out
):
    simulation = make("pybullet")
    home = simulation.executor.command
    start(
        simulation,
        plan(1.0, home, home + 0.3 * np.eye(6)[0]),
        path_tolerance=(JointTolerance("joint_a1", 1e-9),),
    )
    sentence = run_out(simulation).sentence
    error = float(sentence.split("error is ")[1].split(" ")[0])
    assert abs(error) > 1e-9


@settings(max_examples=8, deadline=None)
@given(at=st.floats(0.3, 2.0), duration=st.floats(0.9, 1.6), turn=st.floats(-0.6, 0.6))
def test_in_t1_no_replacement_takes_the_tool_past_250_mm_per_s(
    make, plan, start, cell, at, duration, turn
):
    home = np.array(cell.machine_home)
    simulation = make(controller=ControllerSettings(operating_mode="T1", enabling_switch=True))
    start(simulation, plan(3.0, home, home + 0.6 * np.eye(6)[0]))
    before = positions(simulation, at)
    with suppress(TrajectoryRefusedError):
        start(simulation, plan([duration], home + turn * np.eye(6)[0]), allow_collision=True)
    q = np.vstack((before, positions(simulation, 2.0)))
    tcp = Chain(cell.robot, cell.base_pose, cell.tcp).tcp_poses(q)[:, :3, 3]
    assert (np.linalg.norm(np.diff(tcp, axis=0), axis=1) / DT).max() <= 0.25


def test_in_t1_a_replacement_that_would_be_too_fast_is_refused_and_the_first_goes_on(
    make, plan, start, run_out, home
):
    simulation = make(controller=ControllerSettings(operating_mode="T1", enabling_switch=True))
    there = home + 0.6 * np.eye(6)[0]
    first = start(simulation, plan(3.0, home, there))
    simulation.run(1.0)
    with pytest.raises(TrajectoryRefusedError, match=r"would pass 250 mm/s \(T1\)"):
        start(simulation, plan([1.0], there))
    outcome = run_out(simulation)
    assert (outcome.goal_id, outcome.code) == (first, ErrorCode.SUCCESSFUL)
