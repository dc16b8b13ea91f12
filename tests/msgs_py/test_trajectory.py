"""A trajectory means one interpolant, knows its content's hash, and says what is wrong with bad
points.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.errors import JointNamesError, TrajectoryError

# float64 rounding of polynomials of degree 5 with values of order 1 and segments over 0.1 s
ROUNDING = 1e-9


def random_trajectory(
    seed: int, points: int = 4, velocities: bool = True, accelerations: bool = True
):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.2, 1.5, points)) - 0.2
    shape = (points, 6)
    return JointTrajectory.from_seconds(
        JOINT_NAMES,
        np.abs(times),
        rng.uniform(-2, 2, shape),
        rng.uniform(-1, 1, shape) if velocities else None,
        rng.uniform(-1, 1, shape) if accelerations else None,
    )


@given(seed=st.integers(0, 2**32 - 1))
def test_quintic_passes_through_position_velocity_and_acceleration_of_every_point(seed):
    trajectory = random_trajectory(seed)
    samples = trajectory.sample(trajectory.times)
    np.testing.assert_allclose(samples.q, trajectory.positions, atol=ROUNDING)
    np.testing.assert_allclose(samples.qd, trajectory.velocities, atol=ROUNDING)
    np.testing.assert_allclose(samples.qdd, trajectory.accelerations, atol=1e3 * ROUNDING)


@given(seed=st.integers(0, 2**32 - 1))
def test_samples_are_the_derivatives_of_each_other(seed):
    trajectory = random_trajectory(seed)
    step = 1e-5
    middle = trajectory.times[:-1] + 0.4 * np.diff(trajectory.times)
    before, at, after = (trajectory.sample(middle + shift) for shift in (-step, 0.0, step))
    for level in range(3):
        difference = (after[level] - before[level]) / (2 * step)
        # central differences: step^2 of the third derivative, and rounding over the step
        np.testing.assert_allclose(difference, at[level + 1], rtol=1e-4, atol=1e-4)


def test_quintic_reproduces_a_cubic_segment_exactly():
    cubic = random_trajectory(1, accelerations=False)
    at_points = cubic.sample(cubic.times[:1]), cubic.sample(cubic.times[1:2] - 1e-12)
    segment = JointTrajectory(
        JOINT_NAMES,
        cubic.times_ns[:2],
        cubic.positions[:2],
        cubic.velocities[:2],
        np.concatenate([samples.qdd for samples in at_points]),
    )
    inside = np.linspace(cubic.times[0], cubic.times[1], 20)[:-1]
    np.testing.assert_allclose(segment.sample(inside).q, cubic.sample(inside).q, atol=ROUNDING)


def test_without_velocities_the_motion_is_linear():
    trajectory = JointTrajectory.from_seconds(("a", "b"), [0, 2, 3], [[0, 1], [4, 1], [4, 0]])
    samples = trajectory.sample([1.0, 2.5])
    np.testing.assert_allclose(samples.q, [[2, 1], [4, 0.5]], atol=ROUNDING)
    np.testing.assert_allclose(samples.qd, [[2, 0], [0, -1]], atol=ROUNDING)
    assert not samples.qdd.any()


def test_the_robot_rests_before_the_first_and_after_the_last_point():
    trajectory = JointTrajectory.from_seconds(("a",), [1, 2], [[0], [3]], [[5], [5]])
    samples = trajectory.sample([0.0, 9.0])
    assert samples.q.tolist() == [[0.0], [3.0]]
    assert not samples.qd.any()
    assert not samples.qdd.any()


def test_one_point_is_a_posture_to_hold():
    trajectory = JointTrajectory.from_seconds(("a", "b"), [0.5], [[1, 2]])
    coefficients, durations = trajectory.coefficients()
    assert coefficients.shape == (0, 2, 6)
    assert durations.shape == (0,)
    assert trajectory.sample([0.0, 0.7]).q.tolist() == [[1, 2], [1, 2]]


def test_times_are_rounded_to_the_nearest_nanosecond():
    trajectory = JointTrajectory.from_seconds(("a",), [0.0, 0.1 + 4e-10, 0.3], [[0], [1], [2]])
    assert trajectory.times_ns.tolist() == [0, 100_000_000, 300_000_000]
    assert trajectory.duration == 0.3


def test_the_id_is_the_hash_of_the_exact_content():
    trajectory = random_trajectory(3)
    again = JointTrajectory(
        trajectory.joint_names,
        trajectory.times_ns,
        trajectory.positions,
        trajectory.velocities,
        trajectory.accelerations,
    )
    assert again.trajectory_id == trajectory.trajectory_id
    assert again == trajectory
    assert hash(again) == hash(trajectory)
    assert len(trajectory.trajectory_id) == 16
    nudged = trajectory.positions.copy()
    nudged[2, 3] = np.nextafter(nudged[2, 3], 9.0)
    others = [
        JointTrajectory(
            JOINT_NAMES,
            trajectory.times_ns,
            nudged,
            trajectory.velocities,
            trajectory.accelerations,
        ),
        JointTrajectory(
            JOINT_NAMES, trajectory.times_ns + 1, trajectory.positions, trajectory.velocities
        ),
        JointTrajectory(JOINT_NAMES, trajectory.times_ns, trajectory.positions),
    ]
    assert len({other.trajectory_id for other in [trajectory, *others]}) == 4


def test_arrays_are_read_only_copies():
    positions = np.zeros((2, 1))
    trajectory = JointTrajectory.from_seconds(("a",), [0, 1], positions)
    positions[:] = 7
    assert not trajectory.positions.any()
    with pytest.raises(ValueError, match="read-only"):
        trajectory.positions[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.coefficients()[0][0] = 1.0


def test_permuted_joints_are_put_into_the_expected_order():
    trajectory = random_trajectory(5)
    order = [3, 1, 0, 5, 4, 2]
    permuted = trajectory.reordered([JOINT_NAMES[i] for i in order])
    assert permuted.positions.tolist() == trajectory.positions[:, order].tolist()
    assert permuted.reordered(JOINT_NAMES) == trajectory


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (("joint_a1", "joint_b2"), "unknown joint 'joint_b2': expected are joint_a1, joint_a2"),
        (("joint_a1",), "joint 'joint_a2' is missing: expected are joint_a1, joint_a2"),
    ],
)
def test_foreign_joint_names_list_the_expected_ones(names, sentence):
    trajectory = JointTrajectory.from_seconds(names, [0], [[0.0] * len(names)])
    with pytest.raises(JointNamesError, match=sentence):
        trajectory.reordered(JOINT_NAMES[:2])


NAN = float("nan")
INF = float("inf")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (([0, 1], [[0, 0], [0, NAN]]), "point 1 joint 1 position is not finite"),
        (([0, 1], [[0, 0], [0, 0]], [[0, -INF], [0, 0]]), "point 0 joint 1 velocity is not finite"),
        (
            ([0, 1], [[0] * 2] * 2, [[0] * 2] * 2, [[0, 0], [NAN, 0]]),
            "point 1 joint 0 acceleration is not finite",
        ),
        (([0, 1, 1], [[0, 0]] * 3), "point 2: time 1.000000000 s is not after 1.000000000 s"),
        (([0, 1, 0.5], [[0, 0]] * 3), "point 2: time 0.500000000 s is not after 1.000000000 s"),
        (([-1, 1], [[0, 0]] * 2), "point 0: time -1.000000000 s is negative"),
        (([0, NAN], [[0, 0]] * 2), "point 1: time nan s is not a duration"),
        (([0, 1e12], [[0, 0]] * 2), "point 1: time 1000000000000.0 s is not a duration"),
        (([], np.zeros((0, 2))), "the trajectory has no points"),
        (
            ([0], [[0, 0, 0]]),
            r"position values have shape \(1, 3\): 1 points of 2 joints are \(1, 2\)",
        ),
        (([0], [[0, 0]], None, [[0, 0]]), "accelerations are given without velocities"),
    ],
)
def test_bad_points_are_named(arguments, sentence):
    with pytest.raises(TrajectoryError, match=sentence):
        JointTrajectory.from_seconds(("a", "b"), *arguments)


def test_names_must_be_there_and_different():
    with pytest.raises(TrajectoryError, match="no joint names"):
        JointTrajectory.from_seconds((), [0], [[]])
    with pytest.raises(JointNamesError, match="'a' is named more than once"):
        JointTrajectory.from_seconds(("a", "a"), [0], [[0, 0]])


def test_the_error_knows_point_and_joint():
    with pytest.raises(TrajectoryError) as caught:
        JointTrajectory.from_seconds(("a", "b"), [0, 1], [[0, 0], [NAN, 0]])
    assert (caught.value.point, caught.value.joint) == (1, 0)
