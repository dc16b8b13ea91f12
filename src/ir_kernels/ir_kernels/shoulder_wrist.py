"""q1 and q5 of an arm whose axes 2 and 3 are parallel, where everything between them and axis 5 is
known.

With z = z2, X the displacement of the hand, E4 that of axis 4 and o, z the lines of the axes
(ArmLines):

    z . R1^T (R z6)              = z . R4 R5 z6             a direction along axis 6
    z . E1^-1 (X o6)             = z . E4 E5 o6             the point of axis 6 nearest to axis 5

Each is a cos q1 + b sin q1 + c = d cos q5 + e sin q5 + f. Where axes 5 and 6 meet, the second has
no q5 and gives q1 first: two angles each. Else q5 is eliminated: a polynomial of degree four in
exp(i q1).
"""

from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_kernels.wrist_geometry import ArmLines
from ir_values.arrays import BoolArray, FloatArray

TOUCH = 1e-9  # of a cosine beyond 1: still a solution, that of a tangent
NEAR_UNIT = 1e-5  # of the length of exp(i q1): two roots at a tangent are known to half the digits
_NOTHING = 1e-12  # m, and of a direction: nothing that an angle could change


class ShoulderPairs(NamedTuple):
    """q1, q5 (N, 4), which exist (N, 4), and how far beyond a tangent each is (N, 4): 0 where it
    exists.
    """

    q1: FloatArray
    q5: FloatArray
    exists: BoolArray
    beyond: FloatArray


class _Sum(NamedTuple):
    """cosine x cos + sine x sin + constant, each (N,)."""

    cosine: FloatArray
    sine: FloatArray
    constant: FloatArray

    def angles(self, value: FloatArray, slack: float) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Both angles (N, 2) at which the sum has a value (N,), whether they exist (N,), and how
        far the cosine is beyond 1 (N,); 0 where any angle does. A cosine up to 1 + slack counts as
        if it were as much below 1.
        """
        # a cos t + b sin t = hypot(a, b) cos(t - atan2(b, a))
        length = portable.hypot(self.cosine, self.sine)
        any_angle = length < _NOTHING
        ratio = (value - self.constant) / np.where(any_angle, 1.0, length)
        folded = np.where(np.abs(ratio) > 1.0, np.sign(ratio) * (2.0 - np.abs(ratio)), ratio)
        turn = portable.arccos(np.clip(folded, -1.0, 1.0))
        middle = portable.arctan2(self.sine, self.cosine)
        angle = np.where(
            any_angle[:, None], 0.0, middle[:, None] + turn[:, None] * np.array([1.0, -1.0])
        )
        exists = np.where(any_angle, np.abs(ratio) < _NOTHING, np.abs(ratio) <= 1.0 + slack)
        beyond = np.where(any_angle & ~exists, np.inf, np.maximum(np.abs(ratio) - 1.0, 0.0))
        return angle, exists, beyond


def _along(to: FloatArray, axis: FloatArray, vector: FloatArray) -> _Sum:
    """to . rot(axis, angle) vector, of directions (3,) or (N, 3) each; by Rodrigues' formula: what
    lies along the axis stays, what is across turns.
    """
    along = np.sum(axis * vector, axis=-1, keepdims=True) * axis
    cosine = np.sum(to * (vector - along), axis=-1)
    sine = np.sum(to * np.cross(axis, vector), axis=-1)
    return _Sum(*np.broadcast_arrays(cosine, sine, np.sum(to * along, axis=-1)))


def shoulder_and_wrist(
    lines: ArmLines, X: FloatArray, E4: FloatArray, slack: float = TOUCH
) -> ShoulderPairs:
    """q1 and q5 for displacements (N, 4, 4) of the hand and of axis 4. slack: how far beyond a
    tangent counts as existing, for those who want guesses near solutions of another E4.
    """
    z = lines.z
    o = lines.o
    hand_turn = X[:, :3, :3]
    z2_before_axis4 = portable.matmul(np.swapaxes(E4[:, :3, :3], 1, 2), z[1])

    # the direction along axis 6, of q1 and of q5
    aim1 = _along(z[1], -z[0], portable.matmul(hand_turn, z[5]))
    aim5 = _along(z2_before_axis4, z[4], np.broadcast_to(z[5], z2_before_axis4.shape))

    # the point of axis 6 nearest to axis 5, of q1 and of q5
    point_of_hand = portable.matmul(hand_turn, o[5]) + X[:, :3, 3]
    reach1 = _along(z[1], -z[0], point_of_hand - o[0])
    fixed = (
        portable.matmul(z2_before_axis4, o[4])
        + portable.matmul(E4[:, :3, 3], z[1])
        - portable.matmul(z[1], o[0])
    )
    if lines.meet:  # no q5 in the second equation: it gives q1 first
        q1, reached, beyond = reach1.angles(fixed, slack)
        return _one_by_one(q1, reached, beyond, aim1, aim5, slack)
    from_axis5 = np.broadcast_to(o[5] - o[4], z2_before_axis4.shape)
    reach5 = _along(z2_before_axis4, z[4], from_axis5)
    reach5 = reach5._replace(constant=reach5.constant + fixed)
    return _together(aim1, aim5, reach1, reach5, max(slack, NEAR_UNIT))


def _one_by_one(
    q1: FloatArray, reached: BoolArray, far: FloatArray, aim1: _Sum, aim5: _Sum, slack: float
) -> ShoulderPairs:
    """Where axes 5 and 6 meet: both q5 for each of two q1 (N, 2) that the second equation gave."""
    pairs = []
    for k in (0, 1):
        value = (
            aim1.cosine * portable.cos(q1[:, k])
            + aim1.sine * portable.sin(q1[:, k])
            + aim1.constant
        )
        q5, aimed, off = aim5.angles(value, slack)
        each = (q1[:, k], reached & aimed, np.maximum(far, off))
        first, exists, beyond = (np.repeat(column[:, None], 2, axis=1) for column in each)
        pairs.append((first, q5, exists, beyond))
    return ShoulderPairs(*(np.concatenate(parts, axis=1) for parts in zip(*pairs, strict=True)))


def _together(aim1: _Sum, aim5: _Sum, reach1: _Sum, reach5: _Sum, slack: float) -> ShoulderPairs:
    """Four pairs of q1 and q5 (n, 4) at which both equations hold: aim1(q1) = aim5(q5), of a
    direction, and reach1(q1) = reach5(q5) [m]. Pairs up to `slack` beyond the unit circle exist.

    M x + m = N y with x, y the unit vectors of q1 and q5: |adj(N) (M x + m)| = |det N|, as
    y = adj(N) (M x + m) / det N has length 1. adj rather than the inverse: det N may be 0.
    """
    N = np.stack([aim5[:2], reach5[:2]]).transpose(2, 0, 1)  # (n, 2, 2)
    scale = np.maximum(np.abs(N).max(axis=2), _NOTHING)  # both rows without a unit
    N = N / scale[:, :, None]
    M = np.stack([aim1[:2], reach1[:2]]).transpose(2, 0, 1) / scale[:, :, None]
    of_aim = aim1.constant - aim5.constant
    of_reach = reach1.constant - reach5.constant
    m = np.stack([of_aim, of_reach], axis=1) / scale
    det = N[:, 0, 0] * N[:, 1, 1] - N[:, 0, 1] * N[:, 1, 0]
    adj_row0 = np.stack([N[:, 1, 1], -N[:, 0, 1]], axis=1)
    adj_row1 = np.stack([-N[:, 1, 0], N[:, 0, 0]], axis=1)
    adj = np.stack([adj_row0, adj_row1], axis=1)
    A = portable.matmul(adj, M)
    a = portable.matmul(adj, m[:, :, None])[:, :, 0]

    # q1 from the roots w = exp(i q1); log |w| is how far a root is from the unit circle
    w = _unit_roots(A, a, det)
    length = np.sqrt((w * w).sum(axis=2))
    off_circle = portable.log(length)
    is_off = np.abs(off_circle) > NEAR_UNIT
    q1 = portable.arctan2(w[..., 1], w[..., 0])
    q1 = q1 + np.where(is_off, off_circle, 0.0)  # a pair that just left the circle

    # q5 from y, of which the sign of det N is all that matters
    x = np.stack([portable.cos(q1), portable.sin(q1)], axis=1)  # (n, 2, 4)
    y = (portable.matmul(A, x) + a[:, :, None]) * np.sign(det)[:, None, None]
    q5 = portable.arctan2(y[:, 1], y[:, 0])
    exists = np.abs(off_circle) <= slack
    beyond = np.where(is_off, np.abs(off_circle), 0.0)
    return ShoulderPairs(q1, q5, exists, beyond)


def _unit_roots(A: FloatArray, a: FloatArray, det: FloatArray) -> FloatArray:
    """Roots w (n, 4), real and imaginary parts (n, 4, 2), of |A x + a|^2 = det^2 as a polynomial in
    w = exp(i q1), x = (cos q1, sin q1); A (n, 2, 2), a (n, 2), det (n,).
    """
    conjugate = np.array([1.0, -1.0])
    p = 0.5 * A * conjugate  # A x + a = p w + conj(p) / w + a, p as (n, 2, 2)
    # |p w + a + conj(p) / w|^2 - det^2, times w^2: coefficients of w^4 to w^0, of which the last
    # two are conjugates of the first two
    sizes = (p * p).sum(axis=1)
    square_real = sizes[:, 0] - sizes[:, 1]
    square_imaginary = 2.0 * (p[:, :, 0] * p[:, :, 1]).sum(axis=1)
    square = np.stack([square_real, square_imaginary], axis=1)
    mixed = 2.0 * (p * a[:, :, None]).sum(axis=1)
    middle = 2.0 * sizes.sum(axis=1) + (a * a).sum(axis=1) - det * det
    centre = np.stack([middle, np.zeros_like(middle)], axis=1)
    rows = np.stack([square, mixed, centre, mixed * conjugate, square * conjugate], axis=1)

    # where the first coefficient vanishes the degree is lower: a tiny one sends a root far away
    lengths = np.sqrt((rows * rows).sum(axis=2))
    size = lengths.max(axis=1)
    vanishes = lengths[:, 0] < 1e-14 * np.maximum(size, 1e-300)
    tiny = np.stack([1e-14 * size + 1e-300, np.zeros_like(size)], axis=1)
    rows[vanishes, 0] = tiny[vanishes]
    return portable.roots(rows)
