"""Extremes of a trajectory between its points: never below a sample, and reached."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import UniformSpline
from ir_planner.curves.polynomials import extremes


@given(st.integers(0, 100_000))
@settings(max_examples=60, deadline=None)
def test_extremes_are_those_of_dense_samples(seed: int) -> None:
    rng = np.random.default_rng(seed)
    segments = 4
    joints = 3
    times = np.cumsum(rng.uniform(0.05, 1.0, segments + 1))
    q, qd, qdd = rng.normal(size=(3, segments + 1, joints))
    trajectory = JointTrajectory.from_seconds([f"j{i}" for i in range(joints)], times, q, qd, qdd)
    coefficients, durations = trajectory.coefficients()
    found = extremes(coefficients, durations)
    u = np.linspace(0.0, 1.0, 4001)
    for s in range(segments):
        t = (u * durations[s])[:, None]
        for j in range(joints):
            p = np.polynomial.Polynomial(coefficients[s, j])
            samples = [p.deriv(k)(t[:, 0]) if k else p(t[:, 0]) for k in range(4)]
            scale = [np.abs(values).max() for values in samples]
            assert found.highest[s, j] >= samples[0].max() - 1e-9 * scale[0]
            assert found.lowest[s, j] <= samples[0].min() + 1e-9 * scale[0]
            for values, top in zip(
                samples[1:],
                (found.velocity[s, j], found.acceleration[s, j], found.jerk[s, j]),
                strict=True,
            ):
                assert (
                    np.abs(values).max() * (1 - 1e-9)
                    <= top
                    <= np.abs(values).max() * (1 + 1e-3) + 1e-9
                )
            assert found.travel[s, j] == pytest.approx(np.abs(np.diff(samples[0])).sum(), rel=1e-4)


@given(st.integers(0, 100_000), st.integers(7, 20))
@settings(max_examples=60, deadline=None)
def test_the_travel_of_a_spline_is_that_of_dense_samples(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    control = rng.normal(size=(count, 2)).round(1)  # joints that stand for a while too
    trajectory = UniformSpline(control, float(rng.uniform(0.01, 0.3))).trajectory(("a", "b"))
    travel = extremes(*trajectory.coefficients()).travel.sum(axis=0)
    dense = trajectory.sample(np.linspace(0.0, trajectory.duration, 2000 * count + 1)).q
    assert travel == pytest.approx(np.abs(np.diff(dense, axis=0)).sum(axis=0), rel=1e-5, abs=1e-9)


def test_a_line_and_a_standstill_have_no_false_extremes() -> None:
    trajectory = JointTrajectory.from_seconds(["a", "b"], [0.0, 2.0], [[0.0, 1.0], [4.0, 1.0]])
    found = extremes(*trajectory.coefficients())
    assert found.velocity.tolist() == [[2.0, 0.0]]
    assert found.acceleration.tolist() == [[0.0, 0.0]]
    assert found.travel.tolist() == [[4.0, 0.0]]


def test_no_segments_have_no_extremes() -> None:
    assert extremes(np.zeros((0, 6, 6)), np.zeros(0)).velocity.shape == (0, 6)
