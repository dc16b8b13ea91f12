"""Elementary functions, linear algebra and splines of the core: near those of NumPy and SciPy, with
the same bits in every build.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from ir_kernels import compiled, portable
from ir_values.arrays import FloatArray

ULPS = 4.0  # units in the last place: NumPy's own may be one or two off

rng = np.random.default_rng(26)
ANGLES = np.concatenate([rng.uniform(-10.0, 10.0, 4000), rng.uniform(-9e4, 9e4, 500)])
SMALL = rng.uniform(-1.0, 1.0, 4000)
PLACES = np.sort(rng.uniform(0.0, 3.0, 40))
POINTS = rng.uniform(-2.0, 2.0, (40, 6))


def ulps(found: FloatArray, expected: FloatArray, scale: FloatArray | float = 0.0) -> float:
    """The largest error in units in the last place of `expected`, or of `scale` where that is
    larger.
    """
    unit = np.spacing(np.maximum(np.abs(expected), scale))
    return float((np.abs(found - expected) / unit).max())


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sines_are_those_of_numpy(name: str) -> None:
    found = getattr(portable, name)(ANGLES)
    assert ulps(found, getattr(np, name)(ANGLES), 1e-3) <= ULPS


def test_sines_of_angles_beyond_the_reduction_are_right() -> None:
    far = np.array([1e5 + 0.3, -7.1e8, 3e15])
    assert np.abs(portable.sin(far[:2]) - np.sin(far[:2])).max() < 1e-9
    assert np.isnan(portable.sin(np.array([np.inf, np.nan]))).all()
    assert (np.abs(portable.cos(far)) <= 1.0).all()


@pytest.mark.parametrize("name", ["arcsin", "arccos"])
def test_inverse_sines_are_those_of_numpy(name: str) -> None:
    x = np.concatenate([SMALL, [-1.0, 0.0, 1.0]])
    assert ulps(getattr(portable, name)(x), getattr(np, name)(x), 1e-2) <= ULPS


def test_exponentials_logarithms_and_powers_are_those_of_numpy() -> None:
    x = rng.uniform(-30.0, 30.0, 4000)
    positive = np.exp(x)
    assert ulps(portable.exp(x), np.exp(x)) <= ULPS
    assert ulps(portable.log(positive), np.log(positive), 1e-3) <= ULPS
    assert ulps(portable.cbrt(x), np.cbrt(x)) <= ULPS
    near_one = rng.uniform(0.5, 2.0, 4000)
    assert ulps(portable.power(near_one, 1.7), near_one**1.7) <= 2 * ULPS
    assert ulps(portable.power(x, 5), x**5) <= 2 * ULPS
    assert portable.power(2.0, -3) == 0.125
    assert portable.exp(-800.0) == 0.0
    assert portable.log(0.0) == -np.inf


def test_angles_of_vectors_keep_the_signs_of_zeros() -> None:
    x, y = np.meshgrid([-2.0, -0.0, 0.0, 0.5, np.inf], [-np.inf, -3.0, -0.0, 0.0, 1e-9])
    with np.errstate(all="ignore"):
        expected = np.arctan2(y, x)
    found = portable.arctan2(y, x)
    infinite = np.isinf(x) & np.isinf(y)
    assert np.array_equal(np.signbit(found), np.signbit(expected))
    assert ulps(found[~infinite], expected[~infinite]) <= ULPS
    pairs = rng.uniform(-1.0, 1.0, (2, 4000))
    assert ulps(portable.arctan2(*pairs), np.arctan2(*pairs)) <= ULPS
    assert ulps(portable.hypot(*pairs), np.hypot(*pairs)) <= ULPS


@pytest.mark.parametrize(
    "shapes",
    [((3,), (3,)), ((4, 3), (3,)), ((3,), (3, 5)), ((7, 4, 3), (3, 2)), ((4, 3), (7, 3, 2)),
     ((6, 1, 4, 3), (5, 3, 4)), ((5, 4, 4), (4,))],
)  # fmt: skip
def test_a_matrix_product_is_that_of_numpy(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    a, b = (rng.uniform(-1.0, 1.0, shape) for shape in shapes)
    found = portable.matmul(a, b)
    assert found.shape == (a @ b).shape
    assert np.abs(found - a @ b).max() < 1e-14
    assert np.array_equal(portable.matmul(a.T.copy().T, b), found)


def test_linear_equations_are_solved() -> None:
    M = rng.uniform(-1.0, 1.0, (20, 6, 6))
    right = rng.uniform(-1.0, 1.0, (20, 6, 2))
    found = portable.solve(M, right)
    assert np.abs(M @ found - right).max() < 1e-11
    assert np.abs(M @ portable.inv(M) - np.eye(6)).max() < 1e-11
    assert np.abs(M[0] @ portable.solve(M[0], right[0, :, 0]) - right[0, :, 0]).max() < 1e-11
    with pytest.raises(np.linalg.LinAlgError):
        portable.solve(np.zeros((2, 2)), np.ones(2))


def test_singular_values_and_least_squares_are_those_of_numpy() -> None:
    A = rng.uniform(-1.0, 1.0, (9, 5))
    A[:, 4] = A[:, 0] - A[:, 1]  # of rank 4
    right = rng.uniform(-1.0, 1.0, (9, 3))
    values = portable.singular_values(A)
    assert np.abs(values - np.linalg.svd(A, compute_uv=False)).max() < 1e-14
    expected = np.linalg.lstsq(A, right, rcond=None)[0]
    assert np.abs(portable.least_squares(A, right) - expected).max() < 1e-12
    wide = portable.least_squares(A.T, rng.uniform(-1.0, 1.0, (5, 1)))
    assert wide.shape == (9, 1)


def test_a_symmetric_matrix_has_a_root() -> None:
    A = rng.uniform(-1.0, 1.0, (5, 3))
    root = portable.symmetric_root(A @ A.T)
    assert np.abs(root @ root.T - A @ A.T).max() < 1e-14


def test_a_banded_matrix_is_solved_and_one_that_is_not_positive_definite_refused() -> None:
    bands = np.vstack([np.full(30, 0.1), np.full(30, 0.3), np.full(30, 2.0)])
    right = rng.uniform(-1.0, 1.0, (30, 4))
    M = np.diag(bands[2]) + sum(
        np.diag(bands[2 - k, k:], k) + np.diag(bands[2 - k, k:], -k) for k in (1, 2)
    )
    assert np.abs(M @ portable.solve_banded(bands, right) - right).max() < 1e-13
    with pytest.raises(np.linalg.LinAlgError):
        portable.solve_banded(-bands, right)


def test_roots_of_polynomials_are_found() -> None:
    wanted = rng.uniform(-2.0, 2.0, (50, 4, 2))
    polynomials = []
    for row in wanted[..., 0] + 1j * wanted[..., 1]:
        c = np.poly(row) * (0.3 - 2.0j)
        polynomials.append(np.stack([c.real, c.imag], axis=1))
    found = portable.roots(np.stack(polynomials))
    away = np.linalg.norm(found[:, :, None] - wanted[:, None], axis=3).min(axis=2)
    assert away.max() < 1e-9


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_a_spline_through_points_is_that_of_scipy(degree: int) -> None:
    found = portable.interpolating_spline(PLACES, POINTS, degree)
    expected = make_interp_spline(PLACES, POINTS, k=degree)
    at = np.linspace(PLACES[0], PLACES[-1], 500)
    scale = np.abs(expected(at)).max()
    assert np.array_equal(found.t, expected.t)
    assert np.abs(found(at) - expected(at)).max() < 1e-9 * scale


@pytest.mark.parametrize("degree", [3, 5])
def test_a_spline_keeps_the_derivatives_at_its_ends(degree: int) -> None:
    v0, a0, v1, a1 = rng.uniform(-1.0, 1.0, (4, 6))
    knots = None
    if degree == 3:
        inner = np.concatenate(
            [PLACES[:2].mean(keepdims=True), PLACES[1:-1], PLACES[-2:].mean(keepdims=True)]
        )
        knots = np.concatenate([PLACES[:1].repeat(4), inner, PLACES[-1:].repeat(4)])
    found = portable.interpolating_spline(
        PLACES, POINTS, degree, knots=knots, ends=((v0, a0), (v1, a1))
    )
    assert np.abs(found(PLACES) - POINTS).max() < 1e-10
    for at, nu, wanted in ((0, 1, v0), (0, 2, a0), (-1, 1, v1), (-1, 2, a1)):
        assert np.abs(found(PLACES[at], nu) - wanted).max() < 1e-6


def test_places_that_do_not_rise_are_refused() -> None:
    with pytest.raises(ValueError, match="rise"):
        portable.interpolating_spline(np.array([0.0, 0.0, 1.0, 2.0]), np.zeros((4, 1)))


BITS = """
import hashlib, sys
import numpy as np
sys.path[:0] = {path!r}
import test_portable as t
from ir_kernels import compiled, portable as p
a = [p.sin(t.ANGLES), p.cos(t.ANGLES), p.exp(t.SMALL), p.log(abs(t.SMALL)), p.arccos(t.SMALL),
     p.arctan2(t.SMALL, t.SMALL[::-1]), p.power(abs(t.SMALL), 0.6), p.cbrt(t.SMALL),
     p.matmul(t.POINTS, t.POINTS.T), p.solve(t.POINTS[:6], t.POINTS[6:12]),
     p.singular_values(t.POINTS), p.interpolating_spline(t.PLACES, t.POINTS, 5).c]
print(compiled.NAME, hashlib.sha256(b"".join(x.tobytes() for x in a)).hexdigest())
"""


@pytest.mark.skipif(compiled.NAME != "native", reason="compares the native with another build")
def test_both_builds_and_an_old_processor_give_the_same_bits() -> None:
    import os
    from pathlib import Path

    def run(**changed: str) -> tuple[str, str]:
        code = BITS.format(path=[str(Path(__file__).parent)])
        done = subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, **changed},
            capture_output=True,
            text=True,
            check=True,
        )
        name, digest = done.stdout.split()
        return name, digest

    native = run(IR_KERNELS="native")
    old = run(
        IR_KERNELS="baseline",
        OPENBLAS_CORETYPE="Nehalem",
        GLIBC_TUNABLES="glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
    )
    assert (native[0], old[0]) == ("native", "baseline")
    assert native[1] == old[1]
