"""Proof that two arms keep apart, whenever each of them moves.

A movement sweeps its capsules along its time. Two movements are free of each other if no capsule of
the one comes near to any of the other for every pair of instants: then they are at every relative
timing, at any speed and with any stop between. The square of both times is halved, now along the
one, now along the other, until on every piece the distance in its middle exceeds the threshold by
more than both capsules move (`reference.certify` has that bound). A pair of capsules that is proved
on a piece is not looked at within it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import data, geometry
from ir_kernels.chain import Chain
from ir_kernels.data import CapsuleLike
from ir_kernels.errors import KernelError
from ir_kernels.geometry import COLLIDES, FREE, UNDECIDED
from ir_values.arrays import BoolArray, FloatArray, IntArray

ROWS_MAX = 4_000_000
"""Most pieces and pairs of capsules that are looked at together: beyond, a pair is undecided."""


@dataclass(frozen=True)
class Meeting:
    """What was found of two movements: FREE, COLLIDES or UNDECIDED; times [s] of both from their
    starts and the capsules where they are too near (or undecided), and their distance there [m].
    looked_at: pieces and pairs of capsules.
    """

    verdict: int
    times: tuple[float, float] = (0.0, 0.0)
    capsules: tuple[str, str] = ("", "")
    distance: float = np.inf
    looked_at: int = 0


class SweptArm:
    """A movement q(t) = sum_k c_k t^k of a chain, coefficients (S, n, K) over durations (S,) [s],
    as its capsules on pieces of its time: a tree, from the whole movement down to its segments and
    parts of these, which are made when they are asked for, and kept.
    """

    def __init__(
        self,
        chain: Chain,
        capsules: Sequence[CapsuleLike],
        coefficients: ArrayLike,
        durations: ArrayLike,
    ) -> None:
        from ir_kernels.reference import certify  # half of the import time, for who needs it

        self.chain = chain
        self.capsules = geometry.capsules(capsules, chain.n)
        c = data.array(coefficients, "coefficients", (None, chain.n, None))
        span = data.array(durations, "durations", (len(c),))
        if len(c) == 0 or (span < 0.0).any():
            raise KernelError("durations must be at least one, and none of them negative")
        self._motion = certify.Polynomials(c, span)
        self._begins = np.concatenate([[0.0], np.cumsum(span)])
        self._rows = np.arange(len(c))
        self._low = np.zeros(len(c))
        self._high = span.copy()
        self._left = np.full(len(c), -1)
        self._right = np.full(len(c), -1)
        self.segments = np.zeros((0, len(self.capsules.link), 2, 3))
        self.moved = np.zeros((0, len(self.capsules.link)))
        self._look_at(*self._middles_and_spreads(0))
        self.root = self._joined()

    @staticmethod
    def standing(chain: Chain, capsules: Sequence[CapsuleLike], q: ArrayLike) -> SweptArm:
        """An arm that stands at q (n,)."""
        posture = data.array(q, "q", (chain.n,))
        return SweptArm(chain, capsules, posture[None, :, None], np.zeros(1))

    def passed(self, pieces: IntArray) -> BoolArray:
        """Whether the arm is in the middle of each of the pieces (N,) at an instant: not of one of
        several segments.
        """
        found: BoolArray = self._rows[pieces] >= 0
        return found

    def time(self, piece: int) -> float:
        """The middle of a piece within a segment [s from the start]."""
        middle = (self._low[piece] + self._high[piece]) / 2.0
        return float(self._begins[self._rows[piece]] + middle)

    def halves(self, pieces: IntArray) -> tuple[IntArray, IntArray]:
        """The two parts of each of the pieces (N,)."""
        new = np.unique(pieces[self._left[pieces] < 0])
        first = len(self._rows)
        if len(new):
            low = self._low[new]
            high = self._high[new]
            middle = (low + high) / 2.0
            self._left[new] = first + np.arange(len(new))
            self._right[new] = self._left[new] + len(new)
            rows = self._rows[new]
            self._append(
                np.tile(rows, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
            )
            self._look_at(*self._middles_and_spreads(first))
        return self._left[pieces], self._right[pieces]

    def _append(self, rows: IntArray, low: FloatArray, high: FloatArray) -> None:
        self._rows = np.concatenate([self._rows, rows])
        self._low = np.concatenate([self._low, low])
        self._high = np.concatenate([self._high, high])
        none = np.full(len(rows), -1)
        self._left = np.concatenate([self._left, none])
        self._right = np.concatenate([self._right, none])

    def _middles_and_spreads(self, first: int) -> tuple[FloatArray, FloatArray]:
        """Joint values in the middle of the pieces from `first` on, and how far they are from
        there within these, (N, n) each.
        """
        rows = self._rows[first:]
        middle = (self._low[first:] + self._high[first:]) / 2.0
        half = (self._high[first:] - self._low[first:]) / 2.0
        return self._motion.at(rows, middle), self._motion.spread(rows, middle, half)

    def _joined(self) -> int:
        """Pieces of several segments, up to the whole movement; the number of that one."""
        pieces = np.arange(len(self._rows))
        q, spread = self._middles_and_spreads(0)
        low = q - spread
        high = q + spread
        while len(pieces) > 1:
            count = len(pieces) // 2
            left = pieces[: 2 * count : 2]
            right = pieces[1 : 2 * count : 2]
            lowest = np.minimum(low[: 2 * count : 2], low[1 : 2 * count : 2])
            highest = np.maximum(high[: 2 * count : 2], high[1 : 2 * count : 2])
            first = len(self._rows)
            self._append(np.full(count, -1), np.zeros(count), np.zeros(count))
            self._left[first:] = left
            self._right[first:] = right
            self._look_at((lowest + highest) / 2.0, (highest - lowest) / 2.0)
            odd = 2 * count
            pieces = np.concatenate([first + np.arange(count), pieces[odd:]])
            low = np.concatenate([lowest, low[odd:]])
            high = np.concatenate([highest, high[odd:]])
        return int(pieces[0])

    def _look_at(self, q: FloatArray, spread: FloatArray) -> None:
        """Capsules at q (N, n), and how far they move while the joints stay within the spread."""
        from ir_kernels.reference import certify
        from ir_kernels.reference import chain as kinematics

        poses = self.chain.link_poses(np.ascontiguousarray(q))
        frames = poses[:, self.capsules.link]
        turned = np.einsum("ncab,ceb->ncea", frames[..., :3, :3], self.capsules.ends)
        segments = turned + frames[:, :, None, :3, 3]
        axes = kinematics.axes(self.chain.joint_axis, poses)
        slides = self.chain.first_slides
        moved = certify.capsule_bounds(self.capsules.link, axes, segments, spread, slides)[:, :, 0]
        self.segments = np.concatenate([self.segments, segments])
        self.moved = np.concatenate([self.moved, moved])


def meeting(first: SweptArm, second: SweptArm, threshold: float) -> Meeting:
    """Whether the capsules of two arms stay farther apart than the threshold [m] for every pair of
    instants of their movements. FREE is a proof: rounding is counted. Capsules of link 0 of both
    never move: they are not compared with each other.
    """
    from ir_kernels.reference.certify import MARGIN, RESOLUTION

    moves_a = first.capsules.link > 0
    moves_b = second.capsules.link > 0
    pairs = np.argwhere(moves_a[:, None] | moves_b[None, :])
    # open rows (N,): a piece of each movement, and a capsule of each arm
    piece_a = np.full(len(pairs), first.root)
    piece_b = np.full(len(pairs), second.root)
    capsule_a, capsule_b = pairs.T
    looked_at = 0
    while len(piece_a):
        looked_at += len(piece_a)
        distance = _distances(first, second, (piece_a, piece_b), (capsule_a, capsule_b))
        above = distance - threshold
        moved_a = first.moved[piece_a, capsule_a]
        moved_b = second.moved[piece_b, capsule_b]
        moved = moved_a + moved_b
        unproved = above <= moved + MARGIN

        # a collision needs an instant of each movement: pieces of several segments have none
        passed = first.passed(piece_a) & second.passed(piece_b)
        row = int(np.where(passed, above, np.inf).argmin())
        verdict = COLLIDES
        if not passed[row] or above[row] > -MARGIN:
            stuck = unproved & (moved < RESOLUTION) & passed
            too_many = len(piece_a) > ROWS_MAX
            verdict = UNDECIDED if stuck.any() or too_many else FREE
            row = int(stuck.argmax())
        if verdict != FREE:
            times = first.time(int(piece_a[row])), second.time(int(piece_b[row]))
            name_a = first.capsules.names[capsule_a[row]]
            name_b = second.capsules.names[capsule_b[row]]
            return Meeting(verdict, times, (name_a, name_b), float(distance[row]), looked_at)

        # what isn't proved is halved along the movement whose capsule moves farther
        by_first = moved_a[unproved] >= moved_b[unproved]
        piece_a = piece_a[unproved]
        piece_b = piece_b[unproved]
        left_a, right_a = first.halves(piece_a[by_first])
        left_b, right_b = second.halves(piece_b[~by_first])
        piece_a = np.concatenate([left_a, right_a, np.tile(piece_a[~by_first], 2)])
        piece_b = np.concatenate([np.tile(piece_b[by_first], 2), left_b, right_b])
        capsule_a = _twice(capsule_a[unproved], by_first)
        capsule_b = _twice(capsule_b[unproved], by_first)
    return Meeting(FREE, looked_at=looked_at)


def _twice(capsules: IntArray, by_first: BoolArray) -> IntArray:
    """Capsules (N,) of rows that are halved, once for each half: first the rows that are halved
    along the first movement.
    """
    return np.concatenate([np.tile(capsules[by_first], 2), np.tile(capsules[~by_first], 2)])


def _distances(
    first: SweptArm,
    second: SweptArm,
    pieces: tuple[IntArray, IntArray],
    capsules: tuple[IntArray, IntArray],
) -> FloatArray:
    """(N,): distances [m] of capsules in the middle of pieces."""
    from ir_kernels.reference.segments import segment_segment

    one = first.segments[pieces[0], capsules[0]]
    other = second.segments[pieces[1], capsules[1]]
    axes = segment_segment(one[:, 0], one[:, 1], other[:, 0], other[:, 1]).distance
    radius = first.capsules.radius[capsules[0]] + second.capsules.radius[capsules[1]]
    distance: FloatArray = axes - radius
    return distance
