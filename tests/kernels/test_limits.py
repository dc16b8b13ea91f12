"""Exact extremes of polynomial segments, and torque limits that are proved between the samples."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robots import kr210, tool_155

from ir_kernels import DynamicsModel, KernelError
from ir_kernels.dynamics import EXCEEDS, UNDECIDED, WITHIN
from ir_kernels.limits import polynomial_extrema
from ir_kernels.reference.interval import Dual, interval, power, sine_cosine
from ir_kernels.reference.limits import derivative, evaluate
from ir_values.arrays import FloatArray

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
GOAL = np.radians([60.0, -60.0, 70.0, 40.0, -50.0, 0.0])


def rest_to_rest(
    duration: float, start: FloatArray = HOME, goal: FloatArray = GOAL
) -> tuple[FloatArray, FloatArray]:
    """One quintic from rest to rest."""
    c = np.zeros((1, 6, 6))
    c[0, :, 0] = start
    for power_, factor in ((3, 10.0), (4, -15.0), (5, 6.0)):
        c[0, :, power_] = factor * (goal - start) / duration**power_
    return c, np.array([duration])


def sampled(model: DynamicsModel, c: FloatArray, T: FloatArray, count: int) -> FloatArray:
    """Largest |tau| / limit per joint on a grid that is open at the ends (at rest friction has no
    sign).
    """
    worst = np.zeros(6)
    for segment, duration in zip(c, T, strict=True):
        t = duration * (np.arange(count)[:, None] + 0.5) / count
        motion = []
        p = segment
        for _ in range(3):
            motion.append(np.ascontiguousarray(evaluate(p, np.broadcast_to(t, (count, 6)).T).T))
            p = derivative(p)
        ratio = np.abs(model.inverse_dynamics(*motion)) / model.torque_limit(motion[1])
        worst = np.maximum(worst, ratio.max(axis=0))
    return worst


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture]
)  # a module, the same for all examples
@given(st.integers(0, 10**6), st.integers(0, 4), st.integers(1, 6))
def test_nothing_between_the_samples_is_beyond_the_extremes(
    core: Any, seed: int, order: int, terms: int
) -> None:
    rng = np.random.default_rng(seed)
    c = rng.normal(size=(3, 2, terms)) * 10.0 ** rng.integers(-3, 3)
    T = rng.uniform(0.01, 5.0, 3)
    extrema = polynomial_extrema(c, T, order, core=core)
    p = c
    for _ in range(order):
        p = derivative(p) if p.shape[2] > 1 else 0.0 * p
    t = T[:, None, None] * np.linspace(0.0, 1.0, 2001)
    values = evaluate(p, np.broadcast_to(t, (3, 2, 2001)))
    size = np.abs(values).max() + 1e-12
    assert (extrema.maximum >= values.max(axis=2) - 1e-11 * size).all()
    assert (extrema.minimum <= values.min(axis=2) + 1e-11 * size).all()
    at_maximum = evaluate(p, extrema.time_of_maximum[:, :, None])[..., 0]
    assert at_maximum == pytest.approx(extrema.maximum, abs=1e-10 * size)  # and they are taken


def test_double_roots_of_the_derivative_are_found(core: Any) -> None:
    c = np.array([[[0.0, 1.0, -2.0, 4.0 / 3.0, 0.0, 0.0]]])  # derivative (1 - 2 t)^2
    extrema = polynomial_extrema(c, np.array([1.0]), 1, core=core)
    assert extrema.minimum[0, 0] == pytest.approx(0.0, abs=1e-15)
    assert extrema.time_of_minimum[0, 0] == pytest.approx(0.5, abs=1e-7)


def test_extremes_of_rest_to_rest_are_the_textbook_ones() -> None:
    """Quintic from rest to rest: speed 15/8 D/T at T/2, acceleration 10/sqrt(3) D/T^2, jerk 60
    D/T^3 at the ends.
    """
    c, T = rest_to_rest(2.0)
    position, speed, acceleration, jerk = (polynomial_extrema(c, T, order) for order in range(4))
    D = GOAL - HOME
    largest = [np.maximum(-e.minimum[0], e.maximum[0]) for e in (speed, acceleration, jerk)]
    assert largest[0] == pytest.approx(15.0 / 8.0 * np.abs(D) / 2.0)
    assert largest[1] == pytest.approx(10.0 / np.sqrt(3.0) * np.abs(D) / 4.0)
    assert largest[2] == pytest.approx(60.0 * np.abs(D) / 8.0)
    assert position.minimum[0] == pytest.approx(np.minimum(HOME, GOAL))
    assert position.maximum[0] == pytest.approx(np.maximum(HOME, GOAL))
    when = np.where(D > 0.0, speed.time_of_maximum[0], speed.time_of_minimum[0])
    assert when[:5] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.sampled
@pytest.mark.parametrize("duration", [2.0, 1.2, 1.0, 0.85])
def test_bounds_enclose_a_fine_sampling_and_are_sharp(core: Any, duration: float) -> None:
    model = DynamicsModel(kr210(), (tool_155(),), core=core)
    c, T = rest_to_rest(duration)
    bounds = model.torque_bounds(c, T)
    fine = sampled(model, c, T, 20000)
    assert (fine <= bounds.upper).all()
    assert (bounds.sampled <= bounds.upper).all()
    assert (
        bounds.upper - np.maximum(fine, bounds.sampled)
        <= 0.01 * np.maximum(bounds.sampled, 1.0) + 1e-9
    ).all()
    within = bounds.verdict == WITHIN
    exceeds = bounds.verdict == EXCEEDS
    assert (fine[within] <= 1.0).all()
    assert (bounds.sampled[exceeds] > 1.0).all()
    assert not (bounds.verdict == UNDECIDED).any()


def test_bounds_of_random_motions_enclose_their_samples(core: Any) -> None:
    model = DynamicsModel(kr210(), (tool_155(),), core=core)
    rng = np.random.default_rng(0)
    c = rng.normal(size=(4, 6, 6)) * np.array([1.0, 0.5, 0.5, 0.3, 0.2, 0.1])
    c[2, 3, 1:] = 0.0  # a joint that rests through a segment
    T = rng.uniform(0.2, 1.0, 4)
    bounds = model.torque_bounds(c, T, 0.05)
    fine = sampled(model, c, T, 5000)
    assert (fine <= bounds.upper).all()
    assert (bounds.sampled <= fine + 0.05 * np.maximum(fine, 1.0)).all()


def test_a_resting_arm_needs_what_gravity_needs(core: Any) -> None:
    model = DynamicsModel(kr210(), (tool_155(),), core=core)
    c = np.zeros((1, 6, 4))
    c[0, :, 0] = HOME
    bounds = model.torque_bounds(c, np.array([1.0]))
    holding = np.abs(model.inverse_dynamics(HOME[None], np.zeros((1, 6)), np.zeros((1, 6))))[0]
    assert bounds.upper == pytest.approx(holding / model.data.envelope_torque[:, 0], abs=1e-6)
    assert bounds.within


def test_a_spent_budget_leaves_undecided_rather_than_a_guess(core: Any) -> None:
    model = DynamicsModel(kr210(), (tool_155(),), core=core)
    c, T = rest_to_rest(1.0)
    few = model.torque_bounds(c, T, 0.01, max_intervals=20)
    many = model.torque_bounds(c, T, 0.01)
    assert few.intervals <= 20
    assert (few.upper >= many.sampled).all()
    assert few.verdict[2] == UNDECIDED  # 0.998 of the limit of A3: not to be decided so coarsely
    assert many.verdict[2] == WITHIN


@given(st.floats(-3.0, 3.0), st.floats(0.0, 3.5), st.floats(0.0, 1.0))
def test_intervals_of_sine_and_cosine_hold_all_their_values(
    low: float, width: float, inside: float
) -> None:
    x = interval(np.array([low]))
    wide = type(x)(np.array([low]), np.array([low + width]))
    s, c = sine_cosine(wide)
    angle = min(low + inside * width, low + width)
    assert s.lo[0] <= np.sin(angle) <= s.hi[0]
    assert c.lo[0] <= np.cos(angle) <= c.hi[0]


def test_dual_numbers_carry_derivatives() -> None:
    x = Dual(interval(np.array([2.0])), interval(np.array([1.0])))
    y = power(x, -0.5) * x * 3.0 + (1.0 - x)  # 3 sqrt x + 1 - x
    assert y.v.lo[0] <= 3.0 * np.sqrt(2.0) - 1.0 <= y.v.hi[0]
    assert y.d.lo[0] <= 1.5 / np.sqrt(2.0) - 1.0 <= y.d.hi[0]
    assert y.d.hi[0] - y.d.lo[0] < 1e-13


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"coefficients": np.zeros((1, 5, 6))}, r"coefficients has shape \(1, 5, 6\)"),
        ({"coefficients": np.zeros((1, 6, 9))}, "coefficients has shape"),
        ({"coefficients": np.full((1, 6, 6), np.nan)}, r"coefficients\[0, 0, 0\] is nan"),
        ({"durations": np.zeros(1)}, r"durations\[0\] is 0.0 s"),
        ({"durations": np.ones(2)}, "durations has shape"),
        ({"tolerance": 0.0}, "tolerance is 0.0"),
    ],
)
def test_a_bad_argument_is_named(change: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {
        "coefficients": np.zeros((1, 6, 6)),
        "durations": np.ones(1),
    } | change
    with pytest.raises(KernelError, match=message):
        DynamicsModel(kr210()).torque_bounds(**arguments)
