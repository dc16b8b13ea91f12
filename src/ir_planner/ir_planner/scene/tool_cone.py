"""The cone that an axis of the tool stays in along a movement: how far the axis leans, bounds of it
at every instant, and the way back into the cone.

The tilt is the angle between an axis that is fixed in the tool and a direction of the cell. Between
two instants that are h apart the axis, a vector u of length 1, leaves the chord between its two
places by at most |u''| h^2 / 8, and with w the turning speed of the tool |u''| <= |w'| + |w|^2,
where |w| is at most the sum of the joints' speeds. So the sine and the cosine of the tilt are
bounded by those at both ends; what that leaves open is divided until it is decided.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ir_kernels import Chain, portable
from ir_planner.curves import extremes
from ir_values.arrays import BoolArray, FloatArray, IntArray

TILT_TOLERANCE = 1e-6  # rad: proofs show a tilt below the largest allowed one + 1e-6
_END = 2e-7  # rad: of a configuration, so that a proof can begin there
_EDGE = 5e-7  # rad: of what searches prove
_PARTS = 4  # that an undecided interval is divided into
_ROUNDS = 14
_MOST = 200_000  # intervals of a proof
_TIGHT = 1e-5  # rad by which a bound may lie above the largest tilt that was found
_LOOSER = 4.0
_BOUNDS = 12
_INWARDS = 0.7  # of the largest tilt: where configurations outside are brought to
_TURNS = 12
_LONGEST = 0.5  # rad of a joint in one of them
_DAMPING = 1e-4
_STRAIGHT = 1e-9  # sine of a tilt at which every way back is as near
_UPSIDE = 0.5 * np.pi


class TiltProof(NamedTuple):
    """ok (P,): pieces on which the tilt is proved to stay below a level. time (P,): in a piece's
    local time, where it does not; largest [rad]: of all tilts that were looked at.
    """

    ok: BoolArray
    time: FloatArray
    largest: float


@dataclass(frozen=True, eq=False)
class ToolCone:
    """axis (3,) in the frame of the tcp and direction (3,) in the cell, both of length 1; most
    [rad]: the largest angle between them.
    """

    chain: Chain
    axis: FloatArray
    direction: FloatArray
    most: float

    @cached_property
    def axis_of_link(self) -> FloatArray:
        """The axis (3,) in the frame of the last link."""
        return np.asarray(portable.matmul(self.chain.tcp[:3, :3], self.axis))

    def within(self, most: float) -> "ToolCone":
        """The cone with another largest tilt [rad]."""
        return ToolCone(self.chain, self.axis, self.direction, most)

    def tilts(self, q: FloatArray) -> FloatArray:
        """Tilt (N,) rad at q (N, n)."""
        sine, cosine = self._sides(q)
        return portable.arctan2(sine, cosine)

    def holds(self, q: FloatArray) -> BoolArray:
        """Which configurations (N, n) a movement may begin, pass or end at."""
        return np.asarray(self.tilts(q) <= self.most + _END)

    def edges_held(self, q0: FloatArray, q1: FloatArray) -> BoolArray:
        """On which straight movements (N, n) to (N, n) the tilt is proved to stay in the cone."""
        step = q1 - q0
        coefficients = np.stack([q0, step], axis=2)
        bend = self._bend(np.abs(step), np.zeros_like(step))
        return self._proof(coefficients, np.ones(len(q0)), bend, self.most + _EDGE).ok

    def proof(self, coefficients: FloatArray, durations: FloatArray) -> TiltProof:
        """Of a trajectory (S, n, K), (S,) s: whether every tilt stays in the cone."""
        return self._proof(
            coefficients,
            durations,
            self._bend_of(coefficients, durations),
            self.most + TILT_TOLERANCE,
        )

    def largest(self, coefficients: FloatArray, durations: FloatArray) -> float:
        """A bound [rad] of every tilt of a trajectory (S, n, K), (S,) s; inf: none is proved."""
        bend = self._bend_of(coefficients, durations)
        level = float(self.tilts(coefficients[:, :, 0]).max()) + _TIGHT
        tight = _TIGHT
        for _ in range(_BOUNDS):
            found = self._proof(coefficients, durations, bend, level)
            if found.ok.all():
                return min(level, np.pi)
            if found.largest + tight > level:
                level = found.largest + tight
            else:
                tight *= _LOOSER
                level += tight
        return np.inf

    def brought_in(
        self, q: FloatArray, low: FloatArray, high: FloatArray, scale: FloatArray
    ) -> FloatArray:
        """Configurations (N, n), those outside led into the cone by small turns of the joints,
        cheap ones by scale (n,) first, within the limits low, high (n,); some may stay outside.
        """
        q = q.copy()
        cheap = 1.0 / (scale * scale)
        goal = _INWARDS * self.most
        outside = np.flatnonzero(self.tilts(q) > self.most)
        for _ in range(_TURNS):
            if len(outside) == 0:
                break
            q[outside] = np.clip(q[outside] + self._inwards(q[outside], goal, cheap), low, high)
            outside = outside[self.tilts(q[outside]) > 0.5 * (goal + self.most)]
        return q

    def _inwards(self, q: FloatArray, goal: float, cheap: FloatArray) -> FloatArray:
        """Turns (N, n) of the joints [rad] after which the tilt at q (N, n) is about `goal` rad:
        the least ones, damped. cheap (n,): how readily each joint is turned.
        """
        axis = self._axis(q)
        around = np.cross(axis, self.direction)
        sine = np.linalg.norm(around, axis=1)
        cosine = (axis * self.direction).sum(axis=1)
        excess = portable.arctan2(sine, cosine) - goal

        # an axis that points straight away may tilt about anything that lies across it
        aside = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis), axis=1)])
        straight = sine < _STRAIGHT
        around = np.where(straight[:, None], aside, around)
        around /= np.linalg.norm(around, axis=1)[:, None]

        # turning about the axis itself tilts nothing
        turning = self.chain.jacobian(np.ascontiguousarray(q))[:, 3:, :]
        column = axis[:, :, None]
        across = turning - column * (column * turning).sum(axis=1)[:, None, :]
        gram = portable.matmul(across * cheap, across.transpose(0, 2, 1))
        gram += (_DAMPING * cheap.max()) * np.eye(3)
        wanted = (excess[:, None] * around)[:, :, None]
        step = (across * portable.solve(gram, wanted)).sum(axis=1) * cheap
        size = np.abs(step).max(axis=1)
        shorter = np.minimum(1.0, _LONGEST / np.maximum(size, _LONGEST))
        return np.asarray(step * shorter[:, None])

    def _bend_of(self, coefficients: FloatArray, durations: FloatArray) -> FloatArray:
        found = extremes(coefficients, durations)
        return self._bend(found.velocity, found.acceleration)

    def _bend(self, speed: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Bound (P,) of |u''| by the largest speeds and accelerations (P, n) of the joints; a rail
        turns nothing.
        """
        first = int(self.chain.first_slides)
        turning = speed[:, first:].sum(axis=1)
        squares = turning * turning
        # axes that are turned by those before
        between = 0.5 * (squares - (speed[:, first:] * speed[:, first:]).sum(axis=1))
        return np.asarray(squares + between + acceleration[:, first:].sum(axis=1))

    def _axis(self, q: FloatArray) -> FloatArray:
        """The axis (N, 3) in the cell at q (N, n)."""
        last = self.chain.link_poses(np.ascontiguousarray(q))[:, -1, :3, :3]
        return np.asarray((last * self.axis_of_link).sum(axis=2))

    def _sides(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sine and cosine (N,) of the tilt at q (N, n)."""
        if len(q) == 0:
            return np.zeros(0), np.zeros(0)
        axis = self._axis(q)
        sine = np.linalg.norm(np.cross(axis, self.direction), axis=1)
        return np.asarray(sine), np.asarray((axis * self.direction).sum(axis=1))

    def _proof(
        self, coefficients: FloatArray, durations: FloatArray, bend: FloatArray, level: float
    ) -> TiltProof:
        """Of pieces (P, n, K), (P,) s along which the axis bends by at most `bend` (P,) 1/s^2,
        that the tilt stays below `level` rad.

        A part of a piece is proved from its two ends and from how far the axis may bow between
        them; what isn't is halved.
        """
        count = len(durations)
        ok = np.ones(count, dtype=bool)
        time = np.zeros(count)
        piece = np.arange(count)
        begin = np.zeros(count)
        end = durations.astype(np.float64)
        # sine and cosine of the tilt at both ends of each part, (2, parts)
        first = np.stack(self._sides(_at(coefficients, piece, begin)))
        last = np.stack(self._sides(_at(coefficients, piece, end)))
        largest = -np.inf
        for _ in range(_ROUNDS):
            tilt = portable.arctan2(np.maximum(first[0], last[0]), np.minimum(first[1], last[1]))
            ends = np.maximum(portable.arctan2(*first), portable.arctan2(*last))
            largest = max(largest, float(ends.max(initial=-np.inf)))
            beyond = ends > level
            bow = bend[piece] * np.square(end - begin) / 8.0
            unproved = _bound(first, last, bow, tilt) > level
            open_ = ~beyond & ok[piece] & unproved
            for k in np.flatnonzero(beyond):
                if ok[piece[k]]:
                    ok[piece[k]] = False
                    is_at_begin = portable.arctan2(*first[:, k]) > level
                    time[piece[k]] = begin[k] if is_at_begin else end[k]
            open_ &= ok[piece]
            if not open_.any():
                return TiltProof(ok, time, largest)
            piece, begin, end, first, last = self._divided(
                coefficients,
                piece[open_],
                begin[open_],
                end[open_],
                first[:, open_],
                last[:, open_],
            )
            if len(piece) > _MOST:
                break
        ok[piece] = False
        time[piece] = 0.5 * (begin + end)
        return TiltProof(ok, time, largest)

    def _divided(
        self,
        coefficients: FloatArray,
        piece: IntArray,
        begin: FloatArray,
        end: FloatArray,
        first: FloatArray,
        last: FloatArray,
    ) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """The intervals divided into parts."""
        shares = np.arange(1, _PARTS) / _PARTS
        inner = begin[:, None] + shares * (end - begin)[:, None]
        owner = np.repeat(piece, _PARTS - 1)
        sides = np.stack(self._sides(_at(coefficients, owner, inner.ravel())))
        sides = sides.reshape(2, len(piece), _PARTS - 1)
        times = np.concatenate([begin[:, None], inner, end[:, None]], axis=1)
        all_sides = np.concatenate([first[:, :, None], sides, last[:, :, None]], axis=2)
        return (
            np.repeat(piece, _PARTS),
            times[:, :-1].ravel(),
            times[:, 1:].ravel(),
            all_sides[:, :, :-1].reshape(2, -1),
            all_sides[:, :, 1:].reshape(2, -1),
        )


def _bound(first: FloatArray, last: FloatArray, bow: FloatArray, tilt: FloatArray) -> FloatArray:
    """Bound (M,) rad of the tilt between instants with the sines and cosines first, last (2, M),
    when the axis leaves its chord by at most bow (M,).
    """
    cosine = np.clip(np.minimum(first[1], last[1]) - bow, -1.0, 1.0)
    by_cosine = portable.arctan2(np.sqrt((1.0 - cosine) * (1.0 + cosine)), cosine)
    sine = np.minimum(np.maximum(first[0], last[0]) + bow, 1.0)
    by_sine = portable.arctan2(sine, np.sqrt((1.0 - sine) * (1.0 + sine)))
    upright = (tilt < _UPSIDE) & (sine < 1.0)
    return np.asarray(np.where(upright, np.minimum(by_sine, by_cosine), by_cosine))


def _at(coefficients: FloatArray, piece: IntArray, time: FloatArray) -> FloatArray:
    """Configurations (M, n) of pieces (P, n, K) at local times (M,) s."""
    of = coefficients[piece]
    value = of[:, :, -1]
    for k in range(of.shape[2] - 2, -1, -1):
        value = value * time[:, None] + of[:, :, k]
    return np.asarray(value)
