"""Power of the axes between samples: bounds by interval arithmetic enclose it and are sharp."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robots import kr210, tool_155

from ir_kernels import DynamicsModel, KernelError
from ir_kernels.reference.limits import derivative, evaluate
from ir_values.arrays import FloatArray

SHARP = 0.01  # of the power: what pieces of 2 ms may be too large by
PER_PIECE = 21


def motion(seed: int) -> tuple[FloatArray, FloatArray]:
    """Polynomial segments of joints that move, turn and rest."""
    rng = np.random.default_rng(seed)
    c = rng.normal(size=(3, 6, 6)) * np.array([1.0, 1.0, 1.0, 0.6, 0.4, 0.2])
    c[1, rng.integers(6), 1:] = 0.0
    return c, rng.uniform(0.04, 0.15, 3)


def powers(model: DynamicsModel, c: FloatArray, T: FloatArray, pieces: int) -> FloatArray:
    """Power of the axes (pieces, PER_PIECE, n) W of one segment (n, terms), at the pieces' inner
    instants.
    """
    share = (np.arange(PER_PIECE) + 0.5) / PER_PIECE
    t = ((np.arange(pieces)[:, None] + share) * (T / pieces)).ravel()
    samples = []
    p = c
    for _ in range(3):
        samples.append(np.ascontiguousarray(evaluate(p, np.broadcast_to(t, (len(c), len(t)))).T))
        p = derivative(p)
    return model.axis_power(samples[1], model.inverse_dynamics(*samples)).reshape(
        pieces, PER_PIECE, -1
    )


@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 10**6))
def test_no_power_is_above_its_bound_and_the_bound_is_sharp(core: Any, seed: int) -> None:
    model = DynamicsModel(kr210(), (tool_155(),), core=core)
    c, T = motion(seed)
    bounds = model.power_bounds(c, T, 2e-3)
    counts = np.ceil(T / 2e-3).astype(int)
    assert bounds.seconds == pytest.approx(np.repeat(T / counts, counts))
    net = []
    taken = []
    for segment, duration, count in zip(c, T, counts, strict=True):
        power = powers(model, segment, duration, int(count))
        net.append(power.sum(axis=2).max(axis=1))
        taken.append(np.maximum(power, 0.0).sum(axis=2).max(axis=1))
    most = np.concatenate(net)
    largest = np.concatenate(taken)
    assert (bounds.net >= most).all()
    assert (bounds.taken >= largest).all()
    assert bounds.net.max() <= most.max() + SHARP * np.abs(most).max()


def test_without_a_compiler_the_bounds_are_as_sharp(core: Any) -> None:
    """The two recursions multiply intervals in another order, so they don't agree to the last
    place.
    """
    c, T = motion(1)
    mine, reference = (DynamicsModel(kr210(), (tool_155(),), core=each) for each in (core, None))
    bounds = mine.power_bounds(c, T, 5e-3)
    again = reference.power_bounds(c, T, 5e-3)
    assert np.abs(bounds.net - again.net).max() <= SHARP * np.abs(bounds.net).max()
    assert np.abs(bounds.taken - again.taken).max() <= SHARP * bounds.taken.max()


def test_a_piece_without_a_length_is_refused(core: Any) -> None:
    c, T = motion(2)
    with pytest.raises(KernelError, match="longest is 0"):
        DynamicsModel(kr210(), core=core).power_bounds(c, T, 0.0)
