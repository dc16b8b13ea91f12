"""Bad trajectories: each is refused with its code and a sentence, and the robot's state is
unchanged.
"""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.plc import OperatingMode
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.goal import ErrorCode, ExecutionSettings, JointTolerance
from ir_values.errors import TrajectoryError

INVALID = ErrorCode.INVALID_GOAL


@pytest.fixture(scope="module")
def standing(make):
    return make()


@pytest.fixture
def home(cell):
    return np.array(cell.machine_home)


def refused(start, simulation, trajectory, code, *words, **more):
    before = simulation.backend.q.copy(), simulation.executor.goal_id, simulation.modes.mode
    with pytest.raises(TrajectoryRefusedError) as refusal:
        start(simulation, trajectory, **more)
    assert refusal.value.code == code
    for word in words:
        assert word in str(refusal.value)
    after = simulation.backend.q, simulation.executor.goal_id, simulation.modes.mode
    assert np.array_equal(before[0], after[0])
    assert before[1:] == after[1:]


def test_unknown_and_missing_joints_are_named(standing, start, cell, home):
    names = list(cell.robot.joint_names)
    for changed in ([*names[:5], "joint_a7"], names[:5]):
        n = len(changed)
        trajectory = JointTrajectory.from_seconds(changed, [1.0], home[None, :n], np.zeros((1, n)))
        refused(start, standing, trajectory, ErrorCode.INVALID_JOINTS, "joint_a")


def test_a_permuted_order_is_put_right(make, start, run_out, cell, home):
    order = [3, 1, 5, 0, 2, 4]
    names = [cell.robot.joint_names[j] for j in order]
    target = home + 0.1 * np.arange(6.0)
    trajectory = JointTrajectory.from_seconds(names, [2.0], target[None, order], np.zeros((1, 6)))
    simulation = make()
    start(simulation, trajectory)
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL
    assert np.allclose(simulation.backend.q, target)


def test_stamps_of_the_past_and_of_the_far_future(standing, start, plan, home):
    trajectory = plan(1.0, home, home)
    now = 100_000_000_000
    refused(
        start,
        standing,
        trajectory,
        ErrorCode.OLD_HEADER_TIMESTAMP,
        "ago",
        now_ns=now,
        stamp_ns=now - 2 * 10**9,
    )
    refused(
        start, standing, trajectory, INVALID, "at most 10 s", now_ns=now, stamp_ns=now + 11 * 10**9
    )


@pytest.mark.parametrize("excess", [1e-3, 10.0])
def test_a_position_beyond_its_limit_is_named_with_the_excess(
    standing, start, plan, cell, home, excess
):
    beyond = home.copy()
    beyond[1] = cell.robot.position_max[1] + excess
    refused(
        start,
        standing,
        plan([20.0], beyond),
        INVALID,
        "joint_a2",
        "limits are",
        f"{excess:.3g} rad",
    )


def test_a_position_a_billionth_beyond_is_within_the_slack(make, start, run_out, plan, cell, home):
    touching = home.copy()
    # A2 at its limit, the arm above the floor
    touching[1] = cell.robot.position_max[1] + 1e-9
    touching[2] = 0.0
    simulation = make(load="none")
    start(simulation, plan([20.0], touching))
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL


def test_too_fast_too_hard_and_too_heavy_are_distinguished(standing, start, plan, home):
    turn = np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    refused(
        start, standing, plan(1.0, home, home + turn), INVALID, "joint_a1", "rad/s at", "exceeded"
    )
    refused(start, standing, plan(0.2, home, home + 0.1 * turn), INVALID, "joint_a1", "rad/s^2")
    lift = np.array([0.0, 0.0, -0.5, 0.0, 0.0, 0.0])
    refused(start, standing, plan(1.05, home, home + lift), INVALID, "joint_a3", "Nm")


def test_a_start_elsewhere_is_refused_with_joint_and_difference(standing, start, plan, home):
    off = home.copy()
    off[3] += 0.011
    refused(start, standing, plan(1.0, off, off), INVALID, "joint_a4", "+0.011000 rad", "0.01 rad")


def test_a_last_velocity_that_is_not_zero_is_refused(standing, start, cell, home):
    trajectory = JointTrajectory.from_seconds(
        cell.robot.joint_names, [0.0, 1.0], [home, home], [np.zeros(6), np.full(6, 0.05)]
    )
    refused(start, standing, trajectory, INVALID, "point 1", "last velocity")


def test_points_are_bounded(make, start, plan, home):
    simulation = make(execution=ExecutionSettings(max_points=100))
    many = plan(np.linspace(0.0, 10.0, 101), *[home] * 101)
    refused(start, simulation, many, INVALID, "101 points", "at most 100")


def test_effort_and_multi_dof_are_unsupported(standing, start, plan, home):
    refused(start, standing, plan(1.0, home, home), INVALID, "effort", has_effort=True)
    refused(start, standing, plan(1.0, home, home), INVALID, "multi-dof", multi_dof=2)


@pytest.mark.parametrize(
    ("tolerance", "word"),
    [
        (JointTolerance("joint_a1", -2.0), "-2"),
        (JointTolerance("joint_a1", float("nan")), "nan"),
        (JointTolerance("joint_a1", velocity=float("inf")), "inf"),
    ],
)
def test_tolerances_that_mean_nothing_are_refused(standing, start, plan, home, tolerance, word):
    refused(start, standing, plan(1.0, home, home), INVALID, word, path_tolerance=(tolerance,))
    refused(start, standing, plan(1.0, home, home), INVALID, word, goal_tolerance=(tolerance,))


@pytest.mark.parametrize("goal_time", [-2.0, float("nan")])
def test_a_goal_time_that_means_nothing_is_refused(standing, start, plan, home, goal_time):
    refused(start, standing, plan(1.0, home, home), INVALID, "goal_time", goal_time=goal_time)


def test_points_a_nanosecond_apart_are_refused(standing, start, cell, home):
    trajectory = JointTrajectory(
        cell.robot.joint_names,
        np.array([0, 1, 10**9]),
        [home, home + 0.1, home],
        np.zeros((3, 6)),
        np.zeros((3, 6)),
    )
    refused(start, standing, trajectory, INVALID)


@pytest.mark.parametrize("start_mode", ["BUS_POWER_OFF", "HIBERNATION"])
def test_no_goal_without_power(make, start, plan, home, start_mode):
    simulation = make(controller=ControllerSettings(start_mode=start_mode))
    refused(start, simulation, plan(1.0, home, home), INVALID, "drives not powered", start_mode)


@pytest.mark.parametrize("mode", [OperatingMode.T1, OperatingMode.T2])
def test_no_goal_in_manual_mode_without_the_enabling_switch(make, start, plan, home, mode):
    simulation = make()
    simulation.plc.set_operating_mode(mode)
    refused(start, simulation, plan(1.0, home, home), INVALID, mode.name)


def test_with_the_enabling_switch_t1_creeps(make, start, run_out, plan, home):
    simulation = make(controller=ControllerSettings(operating_mode="T1", enabling_switch=True))
    start(simulation, plan(0.6, home, home + np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])))
    fastest = 0.0
    before = simulation.tool.position(simulation.backend.q)
    while not simulation.take_outcomes():
        simulation.step()
        now = simulation.tool.position(simulation.backend.q)
        fastest = max(fastest, float(np.linalg.norm(now - before)) / 0.001)
        before = now
    assert 0.2 < fastest <= 0.25


def test_no_goal_after_drives_off_until_drives_on(make, start, run_out, plan, home):
    simulation = make()
    simulation.plc.set_bit("drives_off", True)
    simulation.run(0.05)
    refused(start, simulation, plan(1.0, home, home), INVALID, "drives_off")
    simulation.plc.set_bit("drives_off", False)
    simulation.plc.set_bit("drives_on", True)
    simulation.run(0.05)
    start(simulation, plan(1.0, home, home))
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL


def test_a_bad_goal_leaves_the_running_one_alone(make, start, run_out, plan, home):
    simulation = make()
    goal_id = start(simulation, plan(2.0, home, home + 0.2))
    simulation.run(0.5)
    refused(start, simulation, plan(1.0, home + 3.0, home), INVALID)
    outcome = run_out(simulation)
    assert (outcome.goal_id, outcome.code) == (goal_id, ErrorCode.SUCCESSFUL)


@pytest.mark.parametrize("bit", ["ab", "hib"])
def test_a_power_bit_in_motion_stops_on_the_path_first(make, start, run_out, plan, home, bit):
    simulation = make()
    trajectory = plan(2.0, home, home + 0.2)
    start(simulation, trajectory)
    simulation.run(1.0)
    simulation.plc.set_bit(bit, True)
    outcome = run_out(simulation)
    assert outcome.code == INVALID
    assert "was requested during the movement" in outcome.sentence
    simulation.run(3.1)
    assert simulation.modes.mode.name in ("BUS_POWER_OFF", "TO_HIBERNATION")


finite = st.floats(-10.0, 10.0)
wild = st.one_of(finite, st.sampled_from([float("nan"), float("inf"), 1e300, -1e300, 5e-324]))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(data=st.data())
def test_no_trajectory_brings_the_driver_down(start, cell, data, fuzzed):
    survive(start, cell, data, fuzzed)


@pytest.mark.long
@settings(max_examples=10_000, deadline=None, derandomize=True)
@given(data=st.data())
def test_ten_thousand_trajectories_don_t_bring_the_driver_down(start, cell, data, fuzzed):
    survive(start, cell, data, fuzzed)


def survive(start, cell, data, fuzzed):
    """Whatever comes in: a named refusal, or a motion that keeps its limits."""
    simulation = fuzzed
    count = data.draw(st.integers(1, 4))
    scale = data.draw(st.sampled_from([1e-3, 0.1, 1.0]))
    points = [[scale * data.draw(wild) for _ in range(6)] for _ in range(count)]
    q = simulation.executor.command + np.array(points)
    times = np.cumsum([data.draw(st.sampled_from([0.0, 1e-9, 0.3, 3.0])) for _ in range(count)])
    shape = data.draw(st.sampled_from(["linear", "cubic", "quintic"]))
    rest = np.zeros((count, 6))
    with contextlib.suppress(TrajectoryError, TrajectoryRefusedError):
        trajectory = JointTrajectory.from_seconds(
            cell.robot.joint_names,
            times,
            q,
            None if shape == "linear" else rest,
            rest if shape == "quintic" else None,
        )
        start(simulation, trajectory)
    before = simulation.backend.q
    simulation.run(data.draw(st.sampled_from([0.01, 0.5])))
    assert np.isfinite(simulation.backend.q).all()
    assert np.abs(simulation.backend.q - before).max() < 2.0


@pytest.fixture(scope="module")
def fuzzed(make):
    return make()
