"""Elementary functions, linear algebra and interpolating splines with the same bits on every
processor.

NumPy and the C library choose their sines and powers by the processor (AVX-512, AVX2 with FMA,
SSE), BLAS and LAPACK their sums: the last bits differ, and a search that compares costs takes
another turn. Where a number decides an answer, these functions take the place of `@`, np.sin,
np.linalg and make_interp_spline: additions, products, quotients and roots of IEEE 754 in one order,
in the native and the baseline build of the core alike (errors: about a unit in the last place).
NumPy's elementwise arithmetic, sums and np.einsum without `optimize` have one order anyway. With
the NumPy reference (no compiled core) they are NumPy's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled
from ir_values.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_CORE = compiled.MODULE


def _of_each(name: str, otherwise: Callable[[ArrayLike], Any]) -> Callable[[ArrayLike], FloatArray]:
    function = getattr(_CORE, name, otherwise)

    def of_each(x: ArrayLike) -> FloatArray:
        result = function(x)
        return cast(FloatArray, result if result.ndim else result[()])

    of_each.__name__ = name
    of_each.__doc__ = f"{name} of each number; a number gives a number."
    return of_each


def _of_pairs(
    name: str, otherwise: Callable[[ArrayLike, ArrayLike], Any]
) -> Callable[[ArrayLike, ArrayLike], FloatArray]:
    function = getattr(_CORE, name, otherwise)

    def of_pairs(x: ArrayLike, y: ArrayLike) -> FloatArray:
        if np.shape(x) != np.shape(y):
            x, y = np.broadcast_arrays(x, y)
        result = function(x, y)
        return cast(FloatArray, result if result.ndim else result[()])

    of_pairs.__name__ = name
    of_pairs.__doc__ = f"{name} of each pair of numbers; arrays broadcast."
    return of_pairs


sin = _of_each("sin", np.sin)
cos = _of_each("cos", np.cos)
exp = _of_each("exp", np.exp)
log = _of_each("log", np.log)
arcsin = _of_each("arcsin", np.arcsin)
arccos = _of_each("arccos", np.arccos)
cbrt = _of_each("cbrt", np.cbrt)
arctan2 = _of_pairs("arctan2", np.arctan2)
hypot = _of_pairs("hypot", np.hypot)
power = _of_pairs("power", np.power)


def matmul(first: ArrayLike, second: ArrayLike, *more: ArrayLike) -> FloatArray:
    """The matrix product as np.matmul, stacks included, from left to right; every sum from its
    first term to its last.
    """
    product = np.matmul if _CORE is None else _CORE.matmul
    result = product(first, second)
    for other in more:
        result = product(result, other)
    return cast(FloatArray, result if result.ndim else result[()])


def norm(vector: ArrayLike) -> float:
    """The length of a vector, or of a matrix as one (Frobenius). For lengths along an axis
    np.linalg.norm has one order already.
    """
    flat = np.ravel(vector)
    return float(np.sqrt((flat * flat).sum()))


def solve(matrices: FloatArray, right: FloatArray) -> FloatArray:
    """x of M x = right with M (..., n, n) and right (n,) for one matrix or (..., n, p) as
    np.linalg.solve. Raises np.linalg.LinAlgError where a matrix is singular.
    """
    if _CORE is None:
        return cast(FloatArray, np.linalg.solve(matrices, right))
    column = right.ndim == 1
    columns = right[:, None] if column else right
    outer = np.broadcast_shapes(matrices.shape[:-2], columns.shape[:-2])
    left = np.broadcast_to(matrices, (*outer, *matrices.shape[-2:]))
    columns = np.broadcast_to(columns, (*outer, *columns.shape[-2:]))
    count = int(np.prod(outer))
    found = _CORE.solve(
        left.reshape(count, *left.shape[-2:]), columns.reshape(count, *columns.shape[-2:])
    )
    if found is None:
        raise np.linalg.LinAlgError("Singular matrix")
    result = found.reshape(columns.shape)
    return cast(FloatArray, result[:, 0] if column else result)


def inv(matrices: FloatArray) -> FloatArray:
    """Inverses of matrices (..., n, n). Raises np.linalg.LinAlgError where one is singular."""
    return solve(matrices, np.eye(matrices.shape[-1]))


def singular_values(matrix: FloatArray) -> FloatArray:
    """The singular values of a matrix (m, n), n of them, falling."""
    if _CORE is None:
        values = np.linalg.svd(matrix, compute_uv=False)
        return np.append(values, np.zeros(matrix.shape[1] - len(values)))
    return cast(FloatArray, _CORE.svd(matrix)[1])


def symmetric_root(matrix: FloatArray) -> FloatArray:
    """R (n, n) with R R^T = M for a symmetric M whose eigenvalues are not negative; columns in the
    order of rising eigenvalues.
    """
    if _CORE is None:
        values, vectors = np.linalg.eigh(matrix)
        return cast(FloatArray, vectors * np.sqrt(np.maximum(values, 0.0)))
    _, values, v = _CORE.svd(matrix)
    return np.ascontiguousarray((v * np.sqrt(values))[:, np.argsort(values, kind="stable")])


def least_squares(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The shortest x (n, p) of the least |M x - right|, M (m, n), right (m, p); singular values
    below max(m, n) eps of the largest count as zero, as in np.linalg.lstsq.
    """
    if _CORE is None:
        return cast(FloatArray, np.linalg.lstsq(matrix, right, rcond=None)[0])
    u, values, v = _CORE.svd(matrix)
    held = values > max(matrix.shape) * np.finfo(float).eps * values.max(initial=0.0)
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=held)
    return matmul(v * inverse, matmul(u.T, right))


def solve_banded(bands: FloatArray, right: FloatArray) -> FloatArray:
    """x (n, p) of M x = right (n, p), M symmetric positive definite in the upper banded form
    (w + 1, n) of scipy.linalg.cholesky_banded. Raises np.linalg.LinAlgError where it is not.
    """
    if _CORE is None:
        from scipy.linalg import solveh_banded

        return np.asarray(solveh_banded(bands, right))
    found = _CORE.solve_banded(bands, right)
    if found is None:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return cast(FloatArray, found)


def roots(polynomials: FloatArray) -> FloatArray:
    """Roots (N, d, 2) of polynomials (N, d + 1, 2), highest power first, whose first coefficient is
    not 0; the last axis holds real and imaginary parts.
    """
    if _CORE is None:
        found = np.stack([np.roots(row) for row in polynomials[..., 0] + 1j * polynomials[..., 1]])
        return np.stack([found.real, found.imag], axis=-1)
    return cast(FloatArray, _CORE.roots(polynomials))


def geomspace(first: float, last: float, count: int) -> FloatArray:
    """Numbers (count,) from `first` to `last`, each the same factor above the one before."""
    values = np.asarray(first * power(last / first, np.arange(count) / max(count - 1, 1)))
    if count > 1:
        values[-1] = last
    return values


Derivatives = tuple[FloatArray, FloatArray]
"""First and second derivative at an end, each of the shape of a point."""


def interpolating_spline(
    x: FloatArray,
    y: FloatArray,
    degree: int = 3,
    *,
    knots: FloatArray | None = None,
    ends: tuple[Derivatives, Derivatives] | None = None,
) -> BSpline:
    """The spline of a degree through y (N, ...) at rising x (N,), as scipy's make_interp_spline.

    Without `ends` with its not-a-knot knots; with the derivatives at both ends over `knots`
    (N + 5 + degree,), or those at the places x. Raises ValueError where x doesn't rise or the
    knots don't fit.
    """
    from scipy.interpolate import BSpline  # a fifth of a second, for who needs a spline

    x = np.asarray(x, dtype=float)
    y = np.asarray(y, dtype=float)
    if (np.diff(x) <= 0.0).any() or len(x) != len(y):
        raise ValueError("the places of an interpolating spline must rise, one for each value")
    if degree == 1 and knots is None and ends is None:
        polyline_knots = np.concatenate([x[:1], x, x[-1:]])
        return BSpline(polyline_knots, y, 1)
    if knots is None:
        inner = x[1:-1] if ends is not None else _not_a_knot(x, degree)
        around = np.ones(degree + 1)
        knots = np.concatenate([x[0] * around, inner, x[-1] * around])
    if _CORE is None:
        return _interpolated_by_scipy(x, y, degree, knots, ends)
    points = y.reshape(len(y), -1)
    first = last = np.zeros((0, points.shape[1]))
    if ends is not None:
        first = np.reshape(ends[0], (2, -1))
        last = np.reshape(ends[1], (2, -1))
    control = _CORE.interpolate(knots, degree, x, points, first, last)
    if control is None:
        raise ValueError("the knots of an interpolating spline don't fit its places")
    return BSpline(knots, control.reshape(-1, *y.shape[1:]), degree)


def _not_a_knot(x: FloatArray, degree: int) -> FloatArray:
    """Inner knots of a spline through places x (N,): the places themselves, of an even degree the
    middles between them, without as many at each end as the conditions there would need.
    """
    if degree % 2:
        left_out = (degree + 1) // 2
        return x[left_out:-left_out]
    left_out = degree // 2
    middles = 0.5 * (x[1:] + x[:-1])
    return np.asarray(middles[left_out:-left_out])


def _interpolated_by_scipy(
    x: FloatArray,
    y: FloatArray,
    degree: int,
    knots: FloatArray,
    ends: tuple[Derivatives, Derivatives] | None,
) -> BSpline:
    from scipy.interpolate import make_interp_spline

    rest: Any = None if ends is None else tuple(list(enumerate(end, start=1)) for end in ends)
    return make_interp_spline(x, y, k=degree, t=knots, bc_type=rest)
