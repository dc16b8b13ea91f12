"""Descents from starts along paths and along a fixed path: the compiled ones are those of the
reference.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from spline_cases import WORKING, kr210_cost

from ir_kernels import KernelError
from ir_kernels.limits import polynomial_samples
from ir_kernels.spline import CubicPath, ProfileDescent, SplineDescent, SplineStarts
from ir_values.arrays import FloatArray

STARTS = SplineStarts(spacing=0.1, slower=1.3, fewest=8, most=12)
EVALUATIONS = 4


def detours(seed: int, count: int) -> list[FloatArray]:
    """Paths (M, 6) of two to four configurations from WORKING."""
    rng = np.random.default_rng(seed)
    return [
        np.concatenate([WORKING[None], WORKING + rng.normal(0.0, 0.5, (1 + k % 3, 6))])
        for k in range(count)
    ]


def passed(count: int = 7) -> tuple[CubicPath, FloatArray]:
    """A cubic path through five configurations, and where a spline passes it."""
    at = np.linspace(0.0, 1.0, 5)
    spline = make_interp_spline(at, WORKING + 0.3 * np.sin(3.0 * at[:, None] + np.arange(6.0)), k=3)
    breaks = np.unique(spline.t)
    cubics = [spline(breaks[:-1], order) / scale for order, scale in enumerate((1, 1, 2, 6))]
    return CubicPath(breaks, np.stack(cubics)), np.linspace(0.0, 1.0, count + 4)[2:-2]


@cache
def along_paths(core: Any) -> list[SplineDescent]:
    return kr210_cost(core, few=True).descend_along(detours(1, 3), STARTS, evaluations=EVALUATIONS)


@cache
def along_one(core: Any, fixed: bool) -> ProfileDescent:
    path, s = passed()
    return kr210_cost(core, few=True).descend_profile(
        path, s, 1.5, fixed_duration=fixed, evaluations=EVALUATIONS
    )


def test_descents_along_paths_are_those_of_the_reference(compiled_core: Any) -> None:
    found, expected = (along_paths(core) for core in (compiled_core, None))
    for a, b in zip(found, expected, strict=True):
        assert (a.evaluations, len(a.control)) == (b.evaluations, len(b.control))
        assert a.value == pytest.approx(b.value, rel=1e-8)
        np.testing.assert_allclose(a.control, b.control, atol=1e-7)
        assert a.interval == pytest.approx(b.interval, rel=1e-8)


def test_a_path_is_descended_from_alone_as_among_others(compiled_core: Any) -> None:
    cost = kr210_cost(compiled_core)
    paths = detours(2, 4)
    together = cost.descend_along(paths, STARTS, evaluations=EVALUATIONS)
    for path, found in zip(paths, together, strict=True):
        (alone,) = cost.descend_along([path], STARTS, evaluations=EVALUATIONS)
        assert (alone.value, alone.control.tobytes()) == (found.value, found.control.tobytes())
        np.testing.assert_array_equal(found.control[[0, 2, -3, -1]], path[[0, 0, -1, -1]])


def test_a_requested_duration_stays(compiled_core: Any) -> None:
    starts = SplineStarts(0.1, 1.3, 8, 12, duration=3.0)
    for found in kr210_cost(compiled_core).descend_along(
        detours(3, 2), starts, evaluations=EVALUATIONS
    ):
        assert found.interval * (len(found.control) - 3) == pytest.approx(3.0)


@pytest.mark.sampled
@pytest.mark.parametrize("fixed", [False, True])
def test_the_profile_along_a_path_is_that_of_the_reference(compiled_core: Any, fixed: bool) -> None:
    found, expected = (along_one(core, fixed) for core in (compiled_core, None))
    assert found.evaluations == expected.evaluations
    assert found.value == pytest.approx(expected.value, rel=1e-8)
    assert found.duration == pytest.approx(expected.duration, rel=1e-8)
    assert (found.duration == 1.5) == fixed
    np.testing.assert_allclose(found.s, expected.s, atol=1e-7)


def test_a_profile_gets_cheaper_with_work(compiled_core: Any) -> None:
    cost = kr210_cost(compiled_core, few=True)
    (path, s) = passed(12)
    values = [
        cost.descend_profile(path, s, 0.6, evaluations=most, tolerance=0.0).value
        for most in (1, 20, 80)
    ]
    assert values[2] < values[1] < values[0]


def test_what_makes_no_sense_is_refused(compiled_core: Any) -> None:
    cost = kr210_cost(compiled_core, few=True)
    (path, s) = passed()
    with pytest.raises(KernelError, match="no length"):
        cost.descend_along([np.repeat(WORKING[None], 2, axis=0)], STARTS, evaluations=5)
    with pytest.raises(KernelError, match="at least 4"):
        cost.descend_profile(path, s[:3], 1.0)
    with pytest.raises(KernelError, match="begins have to rise"):
        polynomial_samples(np.zeros((2, 6, 4)), np.ones(2), np.zeros(2), np.zeros(3))


def test_samples_are_those_of_the_reference(compiled_core: Any) -> None:
    rng = np.random.default_rng(4)
    c = rng.normal(size=(5, 6, 6))
    T = rng.uniform(0.1, 0.5, 5)
    begins = np.concatenate([[0.2], 0.2 + np.cumsum(T)[:-1]])
    times = np.concatenate([begins, rng.uniform(0.0, 3.0, 40), [-1.0, 9.0]])
    found = polynomial_samples(c, T, begins, times, core=compiled_core)
    for a, b in zip(found, polynomial_samples(c, T, begins, times, core=None), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-10)
