"""The descent along a spline: down, with its ends still, the same every time; and what is refused
by name.
"""

import gc
import re
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from builds import every_build, slow_reference
from geometry_cases import CAPSULES, KR210, box
from robots import kr210, random_chain
from spline_cases import (
    along,
    at_rest,
    chain_models,
    kr210_cost,
    kr210_models,
    motion,
    swing,
    terms,
)

from ir_kernels import (
    Chain,
    CollisionModel,
    DynamicsModel,
    KernelError,
    SplineCost,
    SplineDescent,
    compiled,
)
from ir_values.arrays import FloatArray

BLOCK = (box("block", (1.9, 0.35, 1.1), (0.3, 0.3, 2.2)),)  # obstructs `swing`


def moving(control: FloatArray, seed: int = 0) -> FloatArray:
    """q, qd, qdd (2, 3, n) at the ends of a spline that is to begin and end in motion."""
    size = np.array([0.4, 1.0])[:, None]
    values = size * np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 2, control.shape[1]))
    return np.concatenate([control[[0, -1], None], values], axis=1)


def descended(
    core: Any, evaluations: int, **options: Any
) -> tuple[SplineCost, FloatArray, SplineDescent]:
    cost = kr210_cost(core, BLOCK, few=True)
    control = swing(16)
    return cost, control, cost.descend(control, 0.15, evaluations=evaluations, **options)


DESCENTS: tuple[dict[str, Any], ...] = (
    {"fixed_interval": False},
    {"fixed_interval": True},
    {"ends": moving(swing(16))},
)


@pytest.fixture(scope="module")
def of_reference() -> list[SplineDescent]:
    """The reference's descents, which every build is compared with."""
    return [descended(None, 25, **options)[2] for options in DESCENTS]


@pytest.mark.sampled
def test_the_descent_lowers_the_cost_and_reports_it_truly(core: Any) -> None:
    last = np.inf
    for evaluations in (1, 12, 25) if core is None else (1, 12, 25, 50, 200):
        cost, control, found = descended(core, evaluations, tolerance=0.0)
        assert found.evaluations <= evaluations
        assert found.value == cost.value(found.control, found.interval).value
        assert found.value < last
        last = found.value
        if evaluations == 1:
            assert (found.control == control).all()
            assert (found.interval, found.value) == (0.15, cost.value(control, 0.15).value)
    assert last < 0.5 * cost.value(control, 0.15).value


@pytest.mark.sampled
@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(4, 8))]
)
def test_no_pair_is_left_out_that_was_far_some_evaluations_before(
    compiled_core: Any, seed: int
) -> None:
    robot, collision, dynamics = chain_models(seed, 4 + seed % 4)
    control = at_rest(motion(seed, 40, dynamics.n))
    cost = SplineCost(collision, dynamics, terms(robot, len(collision.pairs)), core=compiled_core)
    for evaluations in range(1, 120, 7):
        found = cost.descend(control, 0.2, evaluations=evaluations, tolerance=0.0)
        assert (
            found.value == cost.value(found.control, found.interval).value
        )  # which remembers nothing


def test_ends_stay_where_they_are_and_still(core: Any) -> None:
    _, control, found = descended(core, 40 if core is not None else 12)
    assert (found.control[:3] == control[:3]).all()
    assert (found.control[-3:] == control[-3:]).all()
    assert (found.control[3:-3] != control[3:-3]).all()
    ends = np.array([0.0, (len(control) - 3) * found.interval * (1.0 - 1e-15)])
    assert np.abs(along(found.control, found.interval, ends, 1)).max() < 1e-9
    assert np.abs(along(found.control, found.interval, ends, 2)).max() < 1e-6


@every_build("fixed", [(True,), (False,)], few=0)
def test_ends_in_motion_have_it_whatever_the_interval_becomes(core: Any, fixed: bool) -> None:
    ends = moving(swing(16))
    _, control, found = descended(core, 40, ends=ends, fixed_interval=fixed)
    span = (len(control) - 3) * found.interval
    for k, at in enumerate((0.0, span * (1.0 - 1e-12))):
        for order, most in enumerate((1e-9, 1e-9, 1e-6)):
            there = along(found.control, found.interval, np.array([at]), order)[0]
            assert np.abs(there - ends[k, order]).max() < most
    assert (found.interval == 0.15) is fixed
    start = descended(core, 1, ends=ends, fixed_interval=fixed)[2]
    assert found.value < 0.7 * start.value


@slow_reference
def test_ends_that_rest_give_the_same_bytes_as_none(core: Any) -> None:
    control = swing(16)
    rest = np.zeros((2, 2, control.shape[1]))
    ends = np.concatenate([control[[0, -1], None], rest], axis=1)
    assert same(descended(core, 30)[2], descended(core, 30, ends=ends)[2])


@slow_reference
def test_a_fixed_interval_stays(core: Any) -> None:
    cost, control, found = descended(core, 40, fixed_interval=True)
    assert found.interval == 0.15
    assert found.value < cost.value(control, 0.15).value
    assert descended(core, 40)[2].interval != 0.15


def test_the_descent_leaves_an_obstacle() -> None:
    if compiled.MODULE is None:
        pytest.skip("takes too long")
    collision, _ = kr210_models(BLOCK, few=True)
    control = swing(16)
    found = kr210_cost(compiled.MODULE, BLOCK, few=True).descend(control, 0.15, evaluations=300)
    at = np.linspace(0.0, 13 * found.interval, 100)
    before, after = (
        collision.min_distance(np.ascontiguousarray(along(c, found.interval, at))).distance.min()
        for c in (control, found.control)
    )
    assert before < -0.05
    assert after > 0.01  # of 20 mm: a penalty, not a proof


@slow_reference
def test_it_ends_when_steps_gain_little(core: Any) -> None:
    patient, hasty = (descended(core, 60, tolerance=t)[2] for t in (0.0, 0.5))
    assert hasty.evaluations < patient.evaluations
    assert hasty.value > patient.value


@pytest.mark.long
def test_compiled_descent_is_that_of_the_reference(
    compiled_core: Any, of_reference: list[SplineDescent]
) -> None:
    for options, expected in zip(DESCENTS, of_reference, strict=True):
        found = descended(compiled_core, 25, **options)[2]
        assert found.evaluations == expected.evaluations
        assert found.value == pytest.approx(expected.value, rel=1e-9)
        assert found.interval == pytest.approx(expected.interval, rel=1e-8)
        np.testing.assert_allclose(found.control, expected.control, atol=1e-7)


def same(a: SplineDescent, b: SplineDescent) -> bool:
    return (a.control.tobytes(), a.interval, a.value, a.evaluations) == (
        b.control.tobytes(),
        b.interval,
        b.value,
        b.evaluations,
    )


def test_the_same_start_ends_at_the_same_bytes(core: Any) -> None:
    most = 8 if core is None else 30
    cost, control, first = descended(core, most)
    assert same(first, cost.descend(control, 0.15, evaluations=most))
    cost.descend(swing(40), 0.1, evaluations=2)  # another size in between leaves no trace
    cost.value(swing(9), 0.1)
    assert same(first, cost.descend(control, 0.15, evaluations=most))
    assert same(first, descended(core, most)[2])


@slow_reference
def test_threads_share_one_object(core: Any) -> None:
    cost = kr210_cost(core, BLOCK, few=True)
    starts = [at_rest(motion(seed, 12 + seed, around=swing(12)[0], size=0.3)) for seed in range(4)]
    most, rounds = (4, 1) if core is None else (400, 3)
    alone = [cost.descend(start, 0.15, evaluations=most) for start in starts]
    with ThreadPoolExecutor(4) as pool:
        for _ in range(rounds):
            together = list(
                pool.map(lambda start: cost.descend(start, 0.15, evaluations=most), starts)
            )
            assert all(same(a, b) for a, b in zip(alone, together, strict=True))


def test_other_threads_run_meanwhile() -> None:
    """No thread is preempted here: this one gets its turn before the descent ends, as that
    yields.
    """
    if compiled.MODULE is None:
        pytest.skip("nothing compiled")
    cost = kr210_cost(compiled.MODULE, BLOCK, few=True)
    ready = threading.Event()
    ended = []

    def work() -> None:
        ready.set()
        cost.descend(swing(60), 0.05, evaluations=20000, tolerance=0.0)
        ended.append(True)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)
    try:
        thread = threading.Thread(target=work)
        thread.start()
        ready.wait()
        assert not ended
        thread.join()
    finally:
        sys.setswitchinterval(before)


def test_models_live_as_long_as_the_cost(core: Any) -> None:
    control = swing(16)
    expected = kr210_cost(core, BLOCK, few=True).value(control, 0.15).value
    costs = [kr210_cost(core, BLOCK, few=True) for _ in range(3)]  # their models are gone already
    gc.collect()
    assert {cost.value(control, 0.15).value for cost in costs} == {expected}


def test_numbers_too_large_end_the_descent(core: Any) -> None:
    cost = kr210_cost(core, BLOCK, few=True)
    control = at_rest(motion(1, 12, size=1e200))
    assert not np.isfinite(cost.value(control, 0.1).value)
    found = cost.descend(control, 0.1)
    assert (found.control == control).all()
    assert found.evaluations == 1
    tiny = cost.descend(swing(12), 1e-120, evaluations=20)
    assert (tiny.control[:3] == swing(12)[:3]).all()


def test_arrays_of_terms_may_change_afterwards(core: Any) -> None:
    collision, dynamics = kr210_models(BLOCK, few=True)
    t = terms(kr210(), len(collision.pairs), velocity=np.full(6, 0.5))
    cost = SplineCost(collision, dynamics, t, core=core)
    before = cost.value(swing(16), 0.1).value
    t.velocity[:] = 1e-3
    t.threshold[:] = 1e-3
    assert cost.value(swing(16), 0.1).value == before


COST = kr210_cost(compiled.MODULE, BLOCK, few=True)
GOOD = swing(16)


@pytest.mark.parametrize("call", [COST.value, COST.descend])
@pytest.mark.parametrize(
    "control",
    [
        pytest.param(np.zeros((16, 5)), id="too few joints"),
        pytest.param(np.zeros(6), id="one point"),
        pytest.param(np.zeros((3, 6)), id="too few points"),
        pytest.param(np.zeros((0, 6)), id="empty"),
        pytest.param(np.full((16, 6), np.nan), id="nan"),
        pytest.param(np.full((16, 6), -np.inf), id="inf"),
        pytest.param(np.zeros((16, 12))[:, ::2], id="not contiguous"),
        pytest.param(np.array([["a"] * 6] * 16), id="text"),
        pytest.param(np.zeros((16, 6), complex), id="complex"),
        pytest.param([[0.0] * 6, [0.0] * 5], id="ragged"),
        pytest.param(None, id="none"),
    ],
)
def test_bad_control_points_are_refused_by_name(call: Callable[..., object], control: Any) -> None:
    with pytest.raises(KernelError, match=r"^control\b"):
        call(control, 0.1)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: COST.value(GOOD, 0.0), "interval"),
        (lambda: COST.value(GOOD, -0.1), "interval"),
        (lambda: COST.descend(GOOD, np.nan), "interval"),
        (lambda: COST.descend(GOOD, np.inf), "interval"),
        (lambda: COST.descend(GOOD, "soon"), "interval"),  # type: ignore[arg-type]
        (lambda: COST.value(GOOD, 0.1, np.zeros(12, int)), "row"),
        (lambda: COST.value(GOOD, 0.1, np.zeros((13, 1), int)), "row"),
        (lambda: COST.value(GOOD, 0.1, np.zeros(13)), "row"),
        (lambda: COST.value(GOOD, 0.1, np.ones(13, int)), "row"),
        (lambda: COST.descend(GOOD, 0.1, np.full(13, -1)), "row"),
        (lambda: COST.descend(GOOD, 0.1, np.full(13, 2**40)), "row"),
        (lambda: COST.descend(swing(16)[:6], 0.1), "control"),
        (lambda: COST.descend(GOOD, 0.1, evaluations=0), "evaluations"),
        (lambda: COST.descend(GOOD, 0.1, evaluations=2.5), "evaluations"),  # type: ignore[arg-type]
        (lambda: COST.descend(GOOD, 0.1, tolerance=-1.0), "tolerance"),
        (lambda: COST.descend(GOOD, 0.1, tolerance=np.nan), "tolerance"),
    ],
)
def test_other_bad_arguments_are_refused_by_name(call: Callable[[], object], name: str) -> None:
    with pytest.raises(KernelError, match=rf"^{name}\b"):
        call()


def bad_terms() -> list[Any]:
    six = np.ones(6)
    pairs = len(kr210_models(BLOCK, few=True)[0].pairs)
    cases: list[tuple[str, Any]] = []
    for name in ("velocity", "acceleration", "jerk", "low", "high", "travel"):
        cases += [
            (name, np.ones(5)),
            (name, np.full(6, np.nan)),
            (name, np.full(6, np.inf)),
            (name, 1.0),
        ]
    cases += [(name, -six) for name in ("velocity", "acceleration", "jerk", "travel")]
    cases += [("velocity", 0.0 * six), ("low", 100.0 * six)]
    cases += [("threshold", np.zeros(pairs)), ("threshold", np.zeros((0, pairs)))]
    cases += [("threshold", np.full((1, pairs), value)) for value in (np.nan, np.inf)]
    cases += [("threshold", np.zeros((1, pairs + 1))), ("threshold", np.zeros((1, 0)))]
    cases += [("torque_share", value) for value in (0.0, -0.5, 1.01, np.nan)]
    cases += [("clearance_scale", value) for value in (0.0, -0.01, np.nan, np.inf)]
    for name in ("energy_value", "time_value", "capacity_energy", "clearance_margin"):
        cases += [(name, -1.0), (name, np.nan)]
    cases += [("penalty", -1.0), ("clearance_penalty", -1.0), ("penalty", None)]
    cases += [("regeneration", "sometimes"), ("regeneration", None)]
    return [pytest.param(name, value, id=f"{name} {k}") for k, (name, value) in enumerate(cases)]


@pytest.mark.parametrize(("name", "value"), bad_terms())
def test_bad_terms_are_refused_by_name(name: str, value: Any) -> None:
    collision, dynamics = kr210_models(BLOCK, few=True)
    with pytest.raises(KernelError, match=rf"^terms\.{re.escape(name)}\b"):
        SplineCost(collision, dynamics, terms(kr210(), len(collision.pairs), **{name: value}))


def test_models_of_two_robots_are_refused() -> None:
    collision, _ = kr210_models(BLOCK, few=True)
    t = terms(kr210(), len(collision.pairs))
    for other in (chain_models(0, 5)[2], DynamicsModel(random_chain(np.random.default_rng(0), 6))):
        with pytest.raises(KernelError, match="models of one robot"):
            SplineCost(collision, other, t)
    shifted = kr210().joint_origin.copy()
    shifted[2, 0, 3] += 1e-3
    with pytest.raises(KernelError, match=r"differ by 0\.001"):
        SplineCost(collision, DynamicsModel(replace(kr210(), joint_origin=shifted)), t)


def test_thresholds_without_pairs_have_no_columns() -> None:
    collision = CollisionModel(Chain(KR210), CAPSULES[-1:], (), ())
    dynamics = DynamicsModel(kr210())
    assert SplineCost(collision, dynamics, terms(kr210(), 0)).value(GOOD, 0.1).value > 0.0
    for threshold in (np.zeros((1, 1)), np.zeros((0, 0)), np.zeros(0), 0.02):
        with pytest.raises(KernelError, match=r"^terms\.threshold"):
            SplineCost(collision, dynamics, terms(kr210(), 0, threshold=threshold))
