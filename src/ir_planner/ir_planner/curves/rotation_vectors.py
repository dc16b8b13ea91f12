"""Rotation vectors, turns between orientations, and the rotation spline through orientations.

The same formulas as scipy.spatial.transform, with sines that are equal on every processor. On
right Jacobians of SO(3): G. Chirikjian, Stochastic Models, Information Theory, and Lie Groups,
volume 2 (2012), section 10.6.
"""

import numpy as np

from ir_kernels import portable
from ir_values.arrays import FloatArray
from ir_values.rotations import quaternions_from_rotations, rotations_from_unit_quaternions

_SMALL = 1e-2  # rad: below, series to the fourth power are exact to rounding
_ITERATIONS = 10
_SETTLED = 1e-9  # rad/s that the angular velocities of a spline change by, relative to their size


def rotation_of(vectors: FloatArray) -> FloatArray:
    """Rotations (..., 3, 3) about the directions of vectors (..., 3) by their lengths [rad]."""
    v = np.asarray(vectors, dtype=float)
    square = (v * v).sum(axis=-1)
    angle = np.sqrt(square)
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    # sin(angle / 2) / angle, near 0 by its series
    series = 0.5 - square / 48.0 + (square * square) / 3840.0
    half = np.where(small, series, portable.sin(0.5 * safe) / safe)
    cosine = np.asarray(portable.cos(0.5 * angle))
    return rotations_from_unit_quaternions(
        np.concatenate([v * half[..., None], cosine[..., None]], axis=-1)
    )


def rotation_vector(rotations: FloatArray) -> FloatArray:
    """The shortest vectors (..., 3) [rad] whose `rotation_of` are these rotations (..., 3, 3)."""
    q = quaternions_from_rotations(rotations)
    sine = np.sqrt((q[..., :3] * q[..., :3]).sum(axis=-1))
    angle = 2.0 * np.asarray(portable.arctan2(sine, q[..., 3]))
    small = angle < _SMALL
    # angle / sin(angle / 2), near 0 by its series
    square = angle * angle
    series = 2.0 + square / 12.0 + 7.0 * square * square / 2880.0
    factor = np.where(small, series, angle / np.where(small, 1.0, sine))
    return np.asarray(q[..., :3] * factor[..., None])


def turn_of(rotations: FloatArray) -> FloatArray:
    """Angles (...) of rotations (..., 3, 3) [rad]."""
    q = quaternions_from_rotations(rotations)
    sine = np.sqrt((q[..., :3] * q[..., :3]).sum(axis=-1))
    return np.asarray(2.0 * portable.arctan2(sine, q[..., 3]))


def turned_evenly(first: FloatArray, last: FloatArray, share: FloatArray) -> FloatArray:
    """Rotations (M, 3, 3) at shares (M,) of the shortest turn from one rotation (3, 3) to another
    (spherical linear interpolation).
    """
    turn = rotation_vector(portable.matmul(first.T, last))
    return portable.matmul(first, rotation_of(np.asarray(share)[:, None] * turn))


class RotationSpline:
    """Rotations R_k exp(v) with cubics v in each piece, whose angular velocity and acceleration are
    continuous; the velocity at both ends is the mean of the first and the last piece.

    x (N,): places, rising; cubics (4, N - 1, 3): v from the place before, highest power first.
    Raises ValueError where places don't rise.
    """

    def __init__(self, x: FloatArray, rotations: FloatArray) -> None:
        self.x = np.asarray(x, dtype=float)
        self._first = np.asarray(rotations, dtype=float)
        h = np.diff(self.x)[:, None]
        if (h <= 0.0).any():
            raise ValueError("the places of a rotation spline must rise")
        before = self._first[:-1].transpose(0, 2, 1)
        turn = rotation_vector(portable.matmul(before, self._first[1:]))
        velocity = _velocities(h[:, 0], turn)
        start = velocity[:-1]
        end = _inverse_times(turn, velocity[1:])
        cubic = (h * (start + end) - 2.0 * turn) / portable.power(h, 3)
        square = (3.0 * turn - h * (2.0 * start + end)) / (h * h)
        self.cubics = np.stack([cubic, square, start, np.zeros_like(turn)])

    def __call__(self, at: FloatArray) -> FloatArray:
        """Rotations (M, 3, 3) at places (M,)."""
        at = np.asarray(at, dtype=float)
        k = np.clip(np.searchsorted(self.x, at, side="right") - 1, 0, len(self.x) - 2)
        u = (at - self.x[k])[:, None]
        cubic, square, line, _ = self.cubics[:, k]
        return portable.matmul(self._first[k], rotation_of(u * (line + u * (square + u * cubic))))


def _velocities(h: FloatArray, turn: FloatArray) -> FloatArray:
    """Angular velocities (N, 3) at places h (N - 1,) apart, `turn` (N - 1, 3) rad between."""
    # As of a cubic spline, the velocities that make the acceleration continuous solve a tridiagonal
    # system, here of blocks; what turns depend on beyond that (`_curved`) is iterated.
    mean = turn / h[:, None]
    inner = len(h) - 1
    velocity = np.concatenate([mean, mean[-1:]])
    if inner < 1:
        return velocity
    identity = np.eye(3)
    matrix = np.zeros((inner, 3, inner, 3))
    squares = h[:, None] ** 2
    right = 6.0 * (turn[:-1] / squares[:-1] + turn[1:] / squares[1:])
    after = _inverse_jacobians(turn)
    before = portable.inv(after)
    for k in range(inner):
        matrix[k, :, k] = (4.0 / h[k] + 4.0 / h[k + 1]) * identity
        low = 2.0 / h[k] * before[k]
        high = 2.0 / h[k + 1] * after[k + 1]
        # the velocities at both ends are known: they stand on the right
        if k > 0:
            matrix[k, :, k - 1] = low
        else:
            right[k] -= portable.matmul(low, velocity[0])
        if k + 1 < inner:
            matrix[k, :, k + 1] = high
        else:
            right[k] -= portable.matmul(high, velocity[-1])
    size = 3 * inner
    flat = matrix.reshape(size, size)
    for _ in range(_ITERATIONS):
        end = _inverse_times(turn[:-1], velocity[1:-1])
        sides = (right - _curved(turn[:-1], end)).reshape(size, 1)
        found = portable.solve(flat, sides).reshape(inner, 3)
        change = np.abs(found - velocity[1:-1])
        velocity[1:-1] = found
        settled = _SETTLED * (1.0 + np.abs(found))
        if (change < settled).all():
            break
    return velocity


def _cross_matrices(v: FloatArray) -> FloatArray:
    """(N, 3, 3) with _cross_matrices(v) w = v x w."""
    matrix = np.zeros((len(v), 3, 3))
    matrix[:, 0, 1] = -v[:, 2]
    matrix[:, 0, 2] = v[:, 1]
    matrix[:, 1, 2] = -v[:, 0]
    return matrix - matrix.transpose(0, 2, 1)


def _inverse_jacobians(v: FloatArray) -> FloatArray:
    """(N, 3, 3) from the angular velocity in the turned frame to v'."""
    square = (v * v).sum(axis=1)
    angle = np.sqrt(square)
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    tangent = portable.sin(0.5 * safe) / portable.cos(0.5 * safe)
    factor = np.where(
        small, 1.0 / 12.0 + square / 720.0, (1.0 - 0.5 * safe / tangent) / (safe * safe)
    )
    cross = _cross_matrices(v)
    return np.asarray(
        np.eye(3) + 0.5 * cross + factor[:, None, None] * portable.matmul(cross, cross)
    )


def _inverse_times(v: FloatArray, velocity: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("kij,kj->ki", _inverse_jacobians(v), velocity))


def _curved(v: FloatArray, rate: FloatArray) -> FloatArray:
    """The part (N, 3) of the angular acceleration at v (N, 3) that is quadratic in v' = rate."""
    square = (v * v).sum(axis=1)
    angle = np.sqrt(square)
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    sin = portable.sin(safe)
    cos = portable.cos(safe)
    # derivatives, over the angle, of (1 - cos) / angle^2 and of `third`
    first = np.where(
        small, -1.0 / 12.0, (safe * sin - 2.0 * (1.0 - cos)) / ((safe * safe) * (safe * safe))
    )
    second = np.where(
        small,
        -1.0 / 60.0,
        (3.0 * sin - 2.0 * safe - safe * cos) / ((safe * safe) * (safe * safe) * safe),
    )
    third = np.where(small, 1.0 / 6.0 - square / 120.0, (safe - sin) / ((safe * safe) * safe))
    along = (v * rate).sum(axis=1)
    across = np.cross(v, rate)
    return np.asarray(
        -(along * first)[:, None] * across
        + (along * second)[:, None] * np.cross(v, across)
        + third[:, None] * np.cross(rate, across)
    )
