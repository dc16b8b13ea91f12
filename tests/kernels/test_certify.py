"""A verdict is a proof: what is called free stays free however finely it is sampled, what collides
does.
"""

import numpy as np
import pytest
from geometry_cases import (
    CAPSULES,
    COLUMNS,
    HOME,
    KR210,
    OPEN,
    SELF_PAIRS,
    TCP,
    Body,
    FloatArray,
    box,
    every_kind,
    sample,
)

from ir_kernels import COLLIDES, FREE, UNDECIDED, Chain, CollisionModel, compiled
from ir_kernels.reference.model import Model

SAFETY = 0.02
ROUNDING = 1e-6  # [m] what a proof may be wrong by, at most
FINE = 0.0005  # [rad]
SCENES = [OPEN, COLUMNS, every_kind(np.random.default_rng(3))]


def kr210(bodies: tuple[Body, ...]) -> CollisionModel:
    return CollisionModel(Chain(KR210, tcp=TCP), CAPSULES, bodies, SELF_PAIRS)


def edges(
    rng: np.random.Generator, count: int, length: float = 0.8
) -> tuple[FloatArray, FloatArray]:
    start = sample(rng, count)
    step = rng.uniform(-1.0, 1.0, (count, 6))
    return start, start + length * step / np.abs(step).max(axis=1, keepdims=True)


def along(q0: FloatArray, q1: FloatArray, begin: float, end: float) -> FloatArray:
    count = max(2, int(np.ceil((end - begin) * np.abs(q1 - q0).max() / FINE)))
    return q0 + np.linspace(begin, end, count)[:, None] * (q1 - q0)


@pytest.mark.parametrize("bodies", SCENES)
def test_dense_samples_contradict_no_verdict(bodies: tuple[Body, ...]) -> None:
    model = kr210(bodies)
    q0, q1 = edges(np.random.default_rng(2), 50)
    found = model.certify_edges(q0, q1, SAFETY)
    for k, verdict in enumerate(found.verdict):
        if found.t0[k] > 0.0:
            samples = along(q0[k], q1[k], 0.0, float(found.t0[k]))
            assert model.distances(samples).min() > SAFETY - ROUNDING
        if verdict == FREE:
            assert (found.t0[k], found.t1[k], found.pair[k]) == (1.0, 1.0, -1)
        if verdict == COLLIDES:
            at = (q0[k] + found.t1[k] * (q1[k] - q0[k]))[None]
            assert model.distances(at)[0, found.pair[k]] <= SAFETY + ROUNDING
            assert found.t1[k] - found.t0[k] < 0.05, "the first collision is located"
    assert set(found.verdict.tolist()) == {FREE, COLLIDES}


@pytest.mark.parametrize("bodies", SCENES)
def test_free_edges_with_room_are_decided(bodies: tuple[Body, ...]) -> None:
    model = kr210(bodies)
    q0, q1 = edges(np.random.default_rng(3), 200)
    roomy = np.array(
        [
            model.is_free(along(a, b, 0.0, 1.0)[::20].copy(), SAFETY + 0.008).all()
            for a, b in zip(q0, q1, strict=True)
        ]
    )
    assert roomy.any()
    assert (model.certify_edges(q0[roomy], q1[roomy], SAFETY).verdict == FREE).all()


@pytest.mark.parametrize("bodies", SCENES)
def test_compiled_verdicts_are_those_of_the_reference(bodies: tuple[Body, ...]) -> None:
    if compiled.MODULE is None:
        pytest.skip("nothing compiled to compare with")
    model = kr210(bodies)
    q0, q1 = edges(np.random.default_rng(4), 12)
    ours = model.certify_edges(q0, q1, SAFETY)
    verdict, t0, t1, _ = Model(model._geometry).certify_edges(
        q0, q1, np.full(len(model.pairs), SAFETY)
    )
    assert (ours.verdict == verdict).all()
    np.testing.assert_allclose(ours.t0, t0, atol=0.02)
    np.testing.assert_allclose(ours.t1, t1, atol=0.02)


def wall(distance_from_flange: float) -> Body:
    """A wall in front of the stretched arm."""
    return box("wall", (distance_from_flange + 0.5, 0.0, 1.5), (1.0, 4.0, 3.0))


def test_motion_along_a_wall_at_the_very_threshold_is_undecided() -> None:
    capsules = [c for c in CAPSULES if c.name == "l2"]
    chain = Chain(KR210)
    q = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    reach = 0.35 + 1.15 + 0.18
    model = CollisionModel(chain, capsules, [wall(reach + SAFETY + 1e-4)], ())
    turn_about_itself = q + np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    found = model.certify_edges(q, turn_about_itself, SAFETY)
    assert found.verdict[0] == FREE, "joints beyond the capsule don't move it"
    assert model.certify_edges(q, q, SAFETY).verdict[0] == FREE
    assert model.certify_edges(q, q, SAFETY + 2e-4).verdict[0] == COLLIDES
    near = float(model.min_distance(q).distance[0])
    grazing = model.certify_edges(q, q, near)
    assert grazing.verdict[0] == UNDECIDED
    assert (grazing.t0[0], grazing.pair[0]) == (0.0, 0)


def test_a_thin_plate_between_two_samples_is_found() -> None:
    plate = box("plate", (1.6, 0.0, 1.5), (1.5, 0.001, 3.0))
    model = CollisionModel(Chain(KR210, tcp=TCP), CAPSULES[-1:], [plate], ())
    turn = np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0])
    q0 = HOME - turn
    q1 = HOME + turn
    assert model.is_free(np.array([q0, q1]), 0.0).all()
    found = model.certify_edges(q0[None], q1[None], 0.0)
    assert found.verdict[0] == COLLIDES
    assert 0.0 < found.t0[0] < found.t1[0] < 1.0


def quintics(rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
    """A smooth trajectory of `count` segments from home."""
    durations = rng.uniform(0.2, 0.6, count)
    coefficients = np.zeros((count, 6, 6))
    position = HOME.copy()
    speed = np.zeros(6)
    for k, T in enumerate(durations):
        coefficients[k, :, 0] = position
        coefficients[k, :, 1] = speed
        coefficients[k, :, 2:] = rng.normal(0.0, 0.4, (6, 4)) / T ** np.arange(4)
        powers = T ** np.arange(6)
        position = coefficients[k] @ powers
        speed = coefficients[k, :, 1:] @ (np.arange(1, 6) * powers[:-1])
    return coefficients, durations


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(12))
def test_dense_samples_of_a_trajectory_contradict_no_verdict(seed: int) -> None:
    model = kr210(OPEN)
    coefficients, durations = quintics(np.random.default_rng(seed), 4)
    found = model.certify_trajectory(coefficients, durations, SAFETY)
    begin = 0.0
    lowest = np.inf
    for c, duration in zip(coefficients, durations, strict=True):
        t = np.linspace(0.0, duration, 400)
        q = np.ascontiguousarray(np.polynomial.polynomial.polyval(t, c.T).T)
        d = model.distances(q)
        proved = begin + t < found.interval[0]
        lowest = min(lowest, d.min())
        assert (d[proved] > SAFETY - ROUNDING).all()
        begin += duration
    if found.verdict == FREE:
        assert found.interval == pytest.approx((begin, begin))
        assert 0.0 < found.lower_bound <= lowest - SAFETY + ROUNDING
    else:
        assert found.verdict == COLLIDES
        assert lowest <= SAFETY
    plain = Model(model._geometry).certify_trajectory(
        coefficients, durations, np.full(len(model.pairs), SAFETY)
    )
    assert found.verdict == plain[0]
    assert found.interval == pytest.approx(plain[1:3], abs=0.01)


def test_a_trajectory_that_stands_still_is_what_its_configuration_is() -> None:
    model = kr210(OPEN)
    still = np.zeros((1, 6, 1))
    still[0, :, 0] = HOME
    clear = float(model.min_distance(HOME[None]).distance[0])
    assert model.certify_trajectory(still, [2.0], clear - 1e-4).verdict == FREE
    assert model.certify_trajectory(still, [2.0], clear + 1e-4).verdict == COLLIDES
    assert model.certify_trajectory(still, [0.0], clear - 1e-4).verdict == FREE
