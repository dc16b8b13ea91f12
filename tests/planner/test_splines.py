"""Eq. (10): conditions at the ends, continuity, and the same curve from either way of solving."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ir_planner.curves.joint_spline import spline_through, to_ppoly, virtual_knots
from ir_planner.curves.uniform_spline import at_shares, evenly_spaced

FloatArray = NDArray[np.float64]
number = st.floats(-3.0, 3.0)
duration = st.floats(0.05, 4.0)


# -- the segments as the equation gives them: the reference of spline_through, which is what runs


def first_segment(q0: float, q1: float, v0: float, a0: float, t1: float) -> FloatArray:
    """Coefficients (4,) in u, lowest first, of the cubic from q0 with speed v0 and acceleration a0
    to q1 in t1 s.
    """
    delta = q1 - q0
    return np.array([q0, v0 * t1, a0 * t1**2 / 2, delta - v0 * t1 - a0 * t1**2 / 2])


def middle_segment(q0: float, q1: float, v0: float, a0: float, t: float) -> FloatArray:
    """Coefficients (4,) of a middle cubic: it takes over speed v0 and acceleration a0 of the
    segment before.
    """
    return first_segment(q0, q1, v0, a0, t)


def last_segment(q0: float, qf: float, vf: float, af: float, tn: float) -> FloatArray:
    """Coefficients (4,) of the cubic from q0 to qf, where it ends with speed vf and acceleration af
    after tn s.
    """
    delta = qf - q0
    return np.array(
        [
            q0,
            3 * delta - 2 * vf * tn + af * tn**2 / 2,
            -3 * delta + 3 * vf * tn - af * tn**2,
            delta - vf * tn + af * tn**2 / 2,
        ]
    )


def end_state(coefficients: FloatArray, t: float) -> tuple[float, float, float]:
    """Position, speed and acceleration at the end (u = 1) of a segment that lasts t s."""
    c = coefficients
    return (
        float(c.sum()),
        float((c[1] + 2 * c[2] + 3 * c[3]) / t),
        float((2 * c[2] + 6 * c[3]) / t**2),
    )


@given(number, number, number, number, duration)
def test_the_last_segment_meets_its_end_conditions(
    q0: float, qf: float, vf: float, af: float, t: float
) -> None:
    """With a_f t_n / 2 as printed the conditions fail; with a_f t_n^2 / 2 they hold."""
    c = last_segment(q0, qf, vf, af, t)
    assert c[0] == q0
    assert end_state(c, t) == pytest.approx((qf, vf, af), abs=1e-7 / t**2)
    printed = c.copy()
    printed[1] += af * t / 2 - af * t**2 / 2
    if abs(af * t * (1.0 - t)) > 1e-3:
        assert end_state(printed, t)[0] != pytest.approx(qf, abs=1e-6)


@given(number, number, number, number, duration)
def test_the_first_segment_meets_its_start_conditions(
    q0: float, q1: float, v0: float, a0: float, t: float
) -> None:
    c = first_segment(q0, q1, v0, a0, t)
    assert (c[0], c[1] / t, 2 * c[2] / t**2) == pytest.approx((q0, v0, a0), abs=1e-9)
    assert end_state(c, t)[0] == pytest.approx(q1, abs=1e-9)


def test_five_cubics_of_the_equation_are_the_spline() -> None:
    """First, three middle and last segment in normalised time give the curve that the solver
    gives.
    """
    points = np.array([[0.2], [0.5], [-0.4], [1.1]])
    times = np.array([0.0, 0.8, 1.5, 2.6])
    start = (np.array([0.3]), np.array([-0.5]))
    end = (np.array([0.1]), np.array([0.7]))
    knots = virtual_knots(times)
    spline = spline_through(points, times, knots, start, end)
    q = spline.positions[:, 0]
    t = np.diff(knots)
    state = (0.3, -0.5)
    for k in range(4):
        build = first_segment if k == 0 else middle_segment
        segment = build(q[k], q[k + 1], *state, t[k])
        _, *state_after = end_state(segment, t[k])
        state = (state_after[0], state_after[1])
        assert state == pytest.approx(
            (spline.velocities[k + 1, 0], spline.accelerations[k + 1, 0]), abs=1e-9
        )
    last = last_segment(q[4], q[5], 0.1, 0.7, t[4])
    assert last[1] / t[4] == pytest.approx(state[0], abs=1e-9)
    assert 2 * last[2] / t[4] ** 2 == pytest.approx(state[1], abs=1e-8)


@given(st.integers(3, 12), st.integers(0, 10_000))
def test_many_points_are_passed_at_rest_at_both_ends_and_c2(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (count, 3))
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.5, count - 1))])
    spline = spline_through(points, times, virtual_knots(times))
    curve = to_ppoly(spline)
    assert curve(times) == pytest.approx(points, abs=1e-8)
    for order in (1, 2):
        assert curve(times[[0, -1]], order) == pytest.approx(np.zeros((2, 3)), abs=1e-7)
    inner = spline.times[1:-1]
    for order in (0, 1, 2):
        assert curve(inner - 1e-12, order) == pytest.approx(curve(inner + 1e-12, order), abs=1e-7)


@given(st.integers(2, 12), st.integers(2, 40), st.integers(0, 10_000))
def test_evenly_spaced_points_lie_on_the_path_at_even_lengths(
    corners: int, count: int, seed: int
) -> None:
    path = np.random.default_rng(seed).uniform(-1.0, 1.0, (corners, 3))
    points = evenly_spaced(path, count)
    assert (points[[0, -1]] == path[[0, -1]]).all()
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= length / (count - 1) + 1e-9


@given(st.integers(2, 12), st.integers(0, 3), st.integers(0, 10_000))
def test_shares_of_a_path_are_interpolated_joint_by_joint(
    corners: int, stops: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    path = rng.uniform(-1.0, 1.0, (corners, 3))
    path = np.insert(path, rng.integers(0, corners, stops), path[rng.integers(0, corners)], axis=0)
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    shares = np.sort(np.append(rng.uniform(0.0, 1.0, 7), [0.0, 1.0]))
    expected = [np.interp(shares * passed[-1], passed, path[:, j]) for j in range(3)]
    assert at_shares(path, shares) == pytest.approx(np.stack(expected, axis=1), abs=1e-12)


def test_virtual_knots_halve_the_first_and_the_last_interval() -> None:
    assert virtual_knots(np.array([0.0, 1.0, 3.0, 7.0])).tolist() == [0.0, 0.5, 1.0, 3.0, 5.0, 7.0]
    assert virtual_knots(np.array([1.0, 4.0])).tolist() == [1.0, 2.0, 3.0, 4.0]


def test_times_that_do_not_increase_are_refused() -> None:
    with pytest.raises(ValueError, match="increase"):
        spline_through(
            np.zeros((3, 1)), np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.5, 1.0, 1.0, 1.0])
        )
