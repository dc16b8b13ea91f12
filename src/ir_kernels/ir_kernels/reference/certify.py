"""Proof that a motion keeps all distances above their thresholds, by bisection of time.

Over an interval of time every joint j stays within spread_j of its value in the middle. How far m
can a point of a capsule on link i move meanwhile, seen from link k? Turn the joints one after the
other, the outermost first, j = i..k+1:

    m <- m + spread_j (reach_j + m)

reach_j is the distance of the capsule's axis from joint axis j in the middle: a point that has
moved by m already is at most reach_j + m away from axis j, which has not moved yet. A rail
moves every point by as much as itself: m <- m + spread_1. A distance in the middle that exceeds
threshold + m therefore proves the interval. An interval that is not proved is halved, down to a
movement of RESOLUTION; the rest is undecided.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ir_kernels.geometry import COLLIDES, FREE, UNDECIDED, Geometry
from ir_kernels.reference import chain, collision
from ir_kernels.reference.segments import cross
from ir_values.arrays import FloatArray, IntArray

MARGIN = 1e-9  # [m] more than double precision loses on lengths of some ten metres
RESOLUTION = 1e-6  # [m] an interval whose bodies move less than this isn't halved any more
FRONT = 16  # intervals of a motion that are looked at together, the earliest first
LOCATE = 2.0**-8  # the first collision is located to this part of the motion


class Motion(Protocol):
    """M motions over a parameter."""

    def span(self) -> FloatArray:
        """(M,): the parameter runs from 0 to this."""

    def at(self, rows: IntArray, parameter: FloatArray) -> FloatArray:
        """(I, n): joint values of the motions `rows` (I,) at `parameter` (I,)."""

    def spread(self, rows: IntArray, middle: FloatArray, half: FloatArray) -> FloatArray:
        """(I, n): bound of |q_j(u) - q_j(middle)| for u in middle -+ half [rad]."""


class Edges:
    """Straight segments in joint space from q0 (M, n) to q1 (M, n), parameter 0..1."""

    def __init__(self, q0: FloatArray, q1: FloatArray) -> None:
        self.q0 = q0
        self.step = q1 - q0

    def span(self) -> FloatArray:
        """(M,): every edge runs from 0 to 1."""
        return np.ones(len(self.q0))

    def at(self, rows: IntArray, parameter: FloatArray) -> FloatArray:
        """(I, n): q0 + u (q1 - q0)."""
        result: FloatArray = self.q0[rows] + parameter[:, None] * self.step[rows]
        return result

    def spread(self, rows: IntArray, middle: FloatArray, half: FloatArray) -> FloatArray:
        """(I, n): half of the motion over the interval [rad], exact for a straight segment."""
        result: FloatArray = half[:, None] * np.abs(self.step[rows])
        return result


class Polynomials:
    """Segments q(t) = sum_k c_k t^k of coefficients (M, n, K) over durations (M,), parameter t in
    s.
    """

    def __init__(self, coefficients: FloatArray, durations: FloatArray) -> None:
        self.coefficients = coefficients
        self.durations = durations

    def span(self) -> FloatArray:
        """(M,): the durations [s]."""
        return self.durations

    def at(self, rows: IntArray, parameter: FloatArray) -> FloatArray:
        """(I, n): q(t), by Horner's rule."""
        return self._shifted(rows, parameter)[..., 0]

    def spread(self, rows: IntArray, middle: FloatArray, half: FloatArray) -> FloatArray:
        """(I, n): sum_k |c_k| half^k over k >= 1 [rad], c_k of the polynomial about the middle."""
        shifted = np.abs(self._shifted(rows, middle))
        powers = np.cumprod(np.repeat(half[:, None], shifted.shape[-1] - 1, axis=1), axis=1)
        result: FloatArray = np.einsum("ijk,ik->ij", shifted[..., 1:], powers)
        return result

    def _shifted(self, rows: IntArray, centre: FloatArray) -> FloatArray:
        """Coefficients of the polynomials in t - centre, by repeated Horner division."""
        c = self.coefficients[rows].copy()
        for first in range(c.shape[-1] - 1):
            for k in range(c.shape[-1] - 2, first - 1, -1):
                c[..., k] += centre[:, None] * c[..., k + 1]
        return c


class Outcome(NamedTuple):
    """Per motion: verdict (M,), interval [t0, t1] of the first violation (M,), its pair (M,), and a
    proven bound (M,).

    Everything before t0 is proved free. COLLIDES: at t1 the pair is not above its threshold.
    UNDECIDED: neither could be shown between t0 and t1. FREE: t0 = t1 = the end, pair -1. bound:
    min over all proved intervals of distance - threshold - movement; meaningful for FREE only.
    """

    verdict: NDArray[np.uint8]
    t0: FloatArray
    t1: FloatArray
    pair: IntArray
    bound: FloatArray


def motion_bounds(
    model: Geometry, link_poses: FloatArray, segments: FloatArray, spread: FloatArray
) -> FloatArray:
    """(I, Z): how much each pair's distance can change while joint j moves by at most spread_j (I,
    n) [m].
    """
    axes = chain.axes(model.chain.joint_axis, link_poses)
    bound = capsule_bounds(model.capsules.link, axes, segments, spread, model.chain.first_slides)
    outside = bound[:, model.environment[:, 0], 0]
    links = model.capsules.link
    a, b = model.self_pairs.T
    outer = np.where(links[a] >= links[b], a, b)
    inner = np.where(links[a] >= links[b], b, a)
    return np.concatenate([outside, bound[:, outer, links[inner]]], axis=1)


def capsule_bounds(
    links: IntArray,
    axes: tuple[FloatArray, FloatArray],
    segments: FloatArray,
    spread: FloatArray,
    first_slides: bool,
) -> FloatArray:
    """(I, C, n + 1): how far capsule c of `links` (C,) can move, seen from link k <= its own, while
    joint j moves by at most spread_j (I, n) [m]; axes: origins and directions (I, n, 3);
    first_slides: joint 1 is a rail.
    """
    origin, direction = axes
    bound = np.zeros((len(segments), len(links), spread.shape[1] + 1))
    for c, link in enumerate(links):
        moved = np.zeros(len(segments))
        for j in range(link - 1, -1, -1):
            arm = segments[:, c] - origin[:, None, j]
            reach = np.linalg.norm(cross(arm, direction[:, None, j]), axis=-1).max(axis=1)
            slides = first_slides and j == 0
            moved = moved + spread[:, j] * (1.0 if slides else reach + moved)
            bound[:, c, j] = moved
    return bound


class _Intervals:
    """Intervals [low, high] of the motions `rows` that are open still, the earliest first."""

    def __init__(self, span: FloatArray) -> None:
        self.rows: IntArray = np.arange(len(span))
        self.low = np.zeros(len(span))
        self.high = span.copy()

    def take(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Remove the first FRONT of every motion: their rows and ends."""
        turn = _rank(self.rows) < FRONT
        taken = self.rows[turn], self.low[turn], self.high[turn]
        self._keep(~turn)
        return taken

    def add(self, rows: IntArray, low: FloatArray, high: FloatArray) -> None:
        """More of them."""
        self.rows = np.concatenate([rows, self.rows])
        self.low = np.concatenate([low, self.low])
        self.high = np.concatenate([high, self.high])

    def drop_after(self, ends: FloatArray) -> None:
        """Drop what begins after the end (M,) of its motion, and sort the others."""
        open_ = np.flatnonzero(self.low < ends[self.rows])
        self._keep(open_[np.lexsort((self.low[open_], self.rows[open_]))])

    def _keep(self, which: NDArray[np.bool_] | IntArray) -> None:
        self.rows = self.rows[which]
        self.low = self.low[which]
        self.high = self.high[which]


class _Earliest:
    """The earliest collision (hit) and the earliest interval that stays undecided (stuck) of every
    motion (M,), and the least proved distance above the thresholds.
    """

    def __init__(self, span: FloatArray) -> None:
        self._span = span
        self.hit_at = np.full(len(span), np.inf)
        self._hit_pair = np.full(len(span), -1)
        self._stuck_from = np.full(len(span), np.inf)
        self._stuck_to = span.copy()
        self._stuck_pair = np.full(len(span), -1)
        self.bound = np.full(len(span), np.inf)

    @property
    def ends(self) -> FloatArray:
        """Where (M,) a motion needs no further look."""
        return np.asarray(np.minimum(self.hit_at, self._stuck_from))

    def hit(self, row: int, time: float, pair: int) -> None:
        """A collision."""
        if time < self.hit_at[row]:
            self.hit_at[row] = time
            self._hit_pair[row] = pair

    def stuck(self, row: int, low: float, high: float, pair: int) -> None:
        """An interval that can't be decided."""
        if low < self._stuck_from[row]:
            self._stuck_from[row] = low
            self._stuck_to[row] = high
            self._stuck_pair[row] = pair

    def outcome(self) -> Outcome:
        """What was found, once nothing is open."""
        collides = np.isfinite(self.hit_at)
        doubt = np.isfinite(self._stuck_from)
        verdict = np.where(collides, COLLIDES, np.where(doubt, UNDECIDED, FREE)).astype(np.uint8)
        t1 = np.where(collides, self.hit_at, np.where(doubt, self._stuck_to, self._span))
        pair = np.where(collides, self._hit_pair, self._stuck_pair)
        return Outcome(verdict, np.minimum(self._stuck_from, t1), t1, pair, self.bound)


def certify(model: Geometry, motion: Motion, threshold: FloatArray) -> Outcome:
    """Outcome for every motion; thresholds (Z,) in m, -inf ignores a pair.

    An interval of time is proved where the clearance in its middle exceeds what the capsules can
    move until its ends; others are halved. An interval that is too short to be halved is stuck.
    """
    span = motion.span()
    found = _Earliest(span)
    intervals = _Intervals(span)
    while len(intervals.rows) and len(threshold):
        rows, low, high = intervals.take()
        middle = (low + high) / 2.0
        poses = collision.poses(model, motion.at(rows, middle))
        segments = collision.ends(model, poses)
        above = collision.distances(model, segments) - threshold
        spread = motion.spread(rows, middle, (high - low) / 2.0)
        moved = motion_bounds(model, poses, segments, spread) + MARGIN
        left_over = above - moved

        each = np.arange(len(rows))
        nearest = above.argmin(axis=1)
        doubtful = left_over.argmin(axis=1)
        proved = left_over[each, doubtful]
        hit = above[each, nearest] <= -MARGIN
        free = proved > 0.0
        np.minimum.at(found.bound, rows[free], proved[free])
        for k in np.flatnonzero(hit):
            found.hit(rows[k], middle[k], nearest[k])

        short = high - low < LOCATE * span[rows]
        located = np.isfinite(found.hit_at[rows]) & short
        unresolved = ~hit & (moved[each, doubtful] < RESOLUTION)
        stuck = ~free & (located | unresolved)
        for k in np.flatnonzero(stuck):
            found.stuck(rows[k], low[k], high[k], doubtful[k])

        before = hit & ~stuck  # an earlier collision may lie before the middle
        split = ~free & ~hit & ~stuck
        intervals.add(rows[split], middle[split], high[split])
        intervals.add(rows[split], low[split], middle[split])
        intervals.add(rows[before], low[before], middle[before])
        intervals.drop_after(found.ends)
    return found.outcome()


def _rank(rows: IntArray) -> IntArray:
    """Position of each entry among those of the same (sorted) row."""
    first = np.searchsorted(rows, rows)
    return np.arange(len(rows)) - first
