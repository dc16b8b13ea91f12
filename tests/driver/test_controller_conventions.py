"""What clients of ROS' joint trajectory controller send, and how it is executed here."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ExecutionSettings, JointTolerance, check_trajectory
from ir_sim_driver.motion.goal import ErrorCode

SETTINGS = ExecutionSettings()


@pytest.fixture
def home(cell):
    return np.array(cell.machine_home)


@pytest.fixture(scope="module")
def dynamics(cell):
    return DynamicsModel(cell.robot)


steps = st.lists(
    st.tuples(
        st.floats(0.02, 3.0),
        st.lists(st.floats(-0.25, 0.25), min_size=6, max_size=6),
    ),
    min_size=2,
    max_size=8,
)


@settings(
    max_examples=80,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(steps=steps, first=st.sampled_from([0.0, 1.5]))
def test_lines_are_driven_within_limits_past_every_point(cell, dynamics, home, steps, first):
    """Judged by samples of SciPy's Hermite spline; refused only where ten times the time is too
    short.
    """
    times = first + np.concatenate(([0.0], np.cumsum([step for step, _ in steps])))
    q = home + np.concatenate((np.zeros((1, 6)), np.array([move for _, move in steps])))
    sent = JointTrajectory.from_seconds(cell.robot.joint_names, times, q)
    speed = np.abs(np.diff(q, axis=0)) / np.diff(times)[:, None]
    try:
        executed, note = check_trajectory(sent, cell.robot, dynamics, SETTINGS)
    except TrajectoryRefusedError as error:
        refused = str(error)
    else:
        refused = ""
    if refused:
        assert (speed / cell.robot.velocity_max).max() > 0.2
        assert "times slower" in refused
        return
    t = executed.times
    spline = CubicHermiteSpline(t, executed.positions, executed.velocities)
    dense = np.linspace(t[0], t[-1], 4000)
    slack = 1.0 + 2e-3
    assert (np.abs(spline(dense, 1)) <= cell.robot.velocity_max * slack).all()
    assert (np.abs(spline(dense, 2)) <= cell.robot.acceleration_max * slack).all()
    assert np.allclose(executed.velocities[-1], 0.0)
    assert np.array_equal(executed.positions[-1], q[-1])
    passed = [np.abs(spline(dense) - point).max(axis=1).min() for point in q]
    resolution = np.abs(np.diff(spline(dense), axis=0)).max()
    assert max(passed) <= SETTINGS.corner_tolerance + resolution
    assert np.abs(executed.positions[0] - q[0]).max() <= SETTINGS.corner_tolerance + 1e-9
    shortest = (t[-1] - t[0]) >= (times[-1] - times[0]) - 1e-9
    assert shortest, "it is never faster than sent"
    if "slowed" not in note:
        assert t[-1] - times[-1] <= 2.0


def test_way_points_of_a_test_script_run_and_the_outcome_says_how(make, start, run_out, plan, home):
    simulation = make("pybullet")
    up = home + 0.2 * np.array([1.0, -1.0, 0.5, 0.0, 0.0, 0.0])
    sent = plan([2.0, 4.0, 6.0, 8.0], home, up, home, up, velocities=False)
    start(simulation, sent)
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.SUCCESSFUL, outcome.sentence
    assert "points passed by at most" in outcome.sentence
    assert outcome.label == sent.trajectory_id
    assert np.abs(simulation.backend.q - up).max() < 0.005


def test_lines_that_are_too_fast_are_slowed_and_absurd_ones_refused(
    make, start, run_out, plan, home
):
    simulation = make()
    there = home + np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    start(simulation, plan([1.0, 1.5, 2.0], home, there, home, velocities=False))
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.SUCCESSFUL
    assert "slowed to" in outcome.sentence
    with pytest.raises(
        TrajectoryRefusedError, match=r"times slower to keep the limits: at most 10"
    ):
        start(simulation, plan([1.0, 1.01, 1.02], home, there, home, velocities=False))


@pytest.mark.parametrize(("speed", "moving"), [(0.2, True), (2.0, False)])
def test_a_first_point_at_a_later_time_is_met_in_motion_where_that_takes_no_run_up(
    cell, dynamics, plan, home, speed, moving
):
    """Else in rest: what leads in does not begin far before the point, out of the script's way."""
    turned = home + speed * np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    sent = plan([6.0, 6.5], home, turned, velocities=False)
    executed, _ = check_trajectory(sent, cell.robot, dynamics, SETTINGS)
    assert bool(executed.velocities[0].any()) is moving
    begun = np.abs(executed.positions[0] - home).max()
    assert (0.0 < begun <= SETTINGS.corner_tolerance) if moving else begun == 0.0
    assert np.array_equal(executed.positions[-1], turned)


@pytest.mark.parametrize("times", [[0.0, 1e-9, 3600.0], [0.0, 3599.0, 3599.000000001]])
def test_a_jump_within_a_nanosecond_is_refused_by_its_speed(make, start, plan, home, times):
    with pytest.raises(TrajectoryRefusedError, match=r"driven [\d.e+]+ times slower"):
        start(make(), plan(times, home, home + 0.2, home, velocities=False))


def test_gentle_lines_run_as_sent_without_a_word(make, start, run_out, plan, home):
    simulation = make("pybullet")
    start(simulation, plan([1.0, 2.0, 3.0], home, home + 0.01, home + 0.02, velocities=False))
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.SUCCESSFUL
    assert outcome.sentence == ""
    assert outcome.max_tool_deviation < 0.005


@pytest.mark.parametrize(
    ("tolerance", "words"),
    [
        (JointTolerance("gripper_finger", 0.1), "unknown joint 'gripper_finger' is not used"),
        (JointTolerance("joint_a1", acceleration=0.5), "nothing measures accelerations"),
    ],
)
def test_tolerances_that_can_t_be_used_are_named_in_the_outcome(
    make, start, run_out, plan, home, tolerance, words
):
    simulation = make()
    start(simulation, plan(1.0, home, home), path_tolerance=(tolerance,), goal_time=-1.0)
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.SUCCESSFUL
    assert words in outcome.sentence


def test_the_end_is_held_however_long_nothing_comes(make, start, run_out, plan, home) -> None:
    simulation = make()
    there = home + np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    start(simulation, plan([0.0, 2.0], home, there))
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL
    for _ in range(6):
        simulation.run(5.0)
        assert np.abs(simulation.backend.q - there).max() < 1e-3


@pytest.mark.parametrize("join", [False, True])
def test_a_stamp_in_the_past_starts_late_or_joins_in_the_middle(
    make, start, run_out, plan, home, join
):
    simulation = make("ideal", execution=ExecutionSettings(join_late=join))
    simulation.run(2.0)
    there = home + np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    begun = simulation.time
    now_ns = round(begun * 1e9)
    start(simulation, plan([0.0, 4.0], home, there), now_ns, stamp_ns=now_ns - 1_000_000_000)
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.SUCCESSFUL
    taken = simulation.time - begun
    assert taken == pytest.approx(3.0 if join else 4.0, abs=0.2)
    assert np.abs(simulation.backend.q - there).max() < 1e-3


def test_a_plan_from_the_present_state_at_time_0_is_joined_in_motion(
    make, start, run_out, plan, cell, home
):
    """Replanned in motion: the first point is where the robot is now, with its velocity."""
    simulation = make()
    there = home + np.array([0.5, 0.2, -0.2, 0.3, -0.2, 0.4])
    sent = plan(2.0, home, there)
    start(simulation, sent)
    simulation.run(0.7)
    left = np.linspace(0.7, 2.0, 14)
    state = sent.sample(left)
    replanned = JointTrajectory.from_seconds(
        cell.robot.joint_names, left - left[0], state.q, state.qd, state.qdd
    )
    q = [simulation.backend.q.copy()]
    start(simulation, replanned)
    for _ in range(1500):
        simulation.step()
        q.append(simulation.backend.q.copy())
    outcomes = simulation.take_outcomes()
    assert [outcome.code for outcome in outcomes] == [
        ErrorCode.INVALID_GOAL,  # preempted
        ErrorCode.SUCCESSFUL,
    ]
    acceleration = np.abs(np.diff(q, 2, axis=0)) / simulation.settings.dt**2
    assert (acceleration < 1.05 * cell.robot.acceleration_max + 0.05).all()
    assert np.abs(q[-1] - there).max() < 1e-3


@pytest.mark.parametrize("off", [0.05, -0.3])
def test_a_first_point_elsewhere_at_time_0_in_motion_changes_nothing(
    make, start, run_out, plan, home, off
):
    simulation = make()
    there = home + np.array([0.5, 0.2, -0.2, 0.3, -0.2, 0.4])
    start(simulation, plan(2.0, home, there))
    simulation.run(0.7)
    with pytest.raises(TrajectoryRefusedError):
        start(simulation, plan(2.0, simulation.backend.q + off, home))
    outcome = run_out(simulation)
    assert outcome.code == ErrorCode.SUCCESSFUL
    assert np.abs(simulation.backend.q - there).max() < 1e-3
