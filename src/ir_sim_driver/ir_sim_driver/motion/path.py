"""The commanded path: piecewise polynomials of the path time, evaluated one instant at a time."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from ir_values.arrays import FloatArray

_DERIVATIVE = np.arange(6.0)


class PathMotion(NamedTuple):
    """Position (n,) [rad] and its first two derivatives by path time."""

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray


class Path:
    """q(s) of segments with coefficients (S, n, 6) and durations (S,) [s]; rests at both ends.

    A path without segments stands at `rest` (n,).
    """

    def __init__(self, coefficients: FloatArray, durations: FloatArray, rest: FloatArray) -> None:
        self._c = np.ascontiguousarray(np.swapaxes(coefficients, 1, 2))  # (S, 6, n)
        self._starts = (
            np.concatenate(([0.0], np.cumsum(durations)[:-1])).tolist() if len(durations) else []
        )
        self._lengths = durations.tolist()
        self.duration = float(np.sum(durations))
        self.coefficients = coefficients
        self.durations = durations
        self.start: FloatArray = rest.copy() if not self._starts else coefficients[0, :, 0].copy()
        self.end: FloatArray = (
            rest.copy() if not self._starts else self._at(len(durations) - 1, self._lengths[-1])
        )

    def _at(self, segment: int, t: float) -> FloatArray:
        t2 = t * t
        powers = np.array((1.0, t, t2, t2 * t, t2 * t2, t2 * t2 * t))
        # half the time of @ on arrays this small
        value: FloatArray = np.dot(powers, self._c[segment])
        return value

    def position(self, s: float) -> FloatArray:
        """Position (n,) at path time s [s]."""
        if s <= 0.0:
            return self.start
        if s >= self.duration:
            return self.end
        segment = bisect_right(self._starts, s) - 1
        return self._at(segment, min(s - self._starts[segment], self._lengths[segment]))

    def positions(self, s: FloatArray) -> FloatArray:
        """Positions (K, n) at path times s (K,) [s], all within the path."""
        if not self._starts:
            return np.repeat(self.start[None], len(s), axis=0)
        segment = np.searchsorted(self._starts, s, side="right") - 1
        t = np.minimum(s - np.take(self._starts, segment), np.take(self._lengths, segment))
        powers = np.vander(t, 6, increasing=True)
        positions: FloatArray = np.einsum("kp,kpn->kn", powers, self._c[segment])
        return positions

    def between(self, begin: float, end: float) -> tuple[FloatArray, FloatArray]:
        """Coefficients (S, n, 6) and durations (S,) [s] from one path time to a later one."""
        first = bisect_right(self._starts, begin) - 1
        last = bisect_right(self._starts, end) - 1
        coefficients = self.coefficients[first : last + 1].copy()
        durations = self.durations[first : last + 1].copy()
        skipped = begin - self._starts[first]
        durations[-1] = end - self._starts[last]
        durations[0] -= skipped
        for k in range(6):
            powers = [math.comb(m, k) * skipped ** (m - k) for m in range(k, 6)]
            coefficients[0, :, k] = self.coefficients[first, :, k:] @ np.array(powers)
        some = durations > 0.0
        return coefficients[some], durations[some]

    def motion(self, s: float) -> PathMotion:
        """Position and derivatives at path time s; derivatives are zero before the start and after
        the end.
        """
        if s < 0.0 or s > self.duration or not self._starts:
            rest = np.zeros(len(self.start))
            return PathMotion(self.position(s), rest, rest)
        segment = bisect_right(self._starts, s) - 1
        t = min(s - self._starts[segment], self._lengths[segment])
        c = self._c[segment]
        powers = t**_DERIVATIVE
        once = np.zeros(6)
        twice = np.zeros(6)
        once[1:] = _DERIVATIVE[1:] * powers[:5]
        twice[2:] = (_DERIVATIVE[2:] * _DERIVATIVE[1:5]) * powers[:4]
        return PathMotion(powers @ c, once @ c, twice @ c)


def quintic(before: PathMotion, after: PathMotion, duration: float) -> FloatArray:
    """Coefficients (1, n, 6) of the polynomial that leads from one motion to another in `duration`
    [s].
    """
    T = duration
    q0, v0, a0 = before
    delta = after.q - q0
    v1 = after.qd
    a1 = after.qdd
    return np.stack(
        [
            q0,
            v0,
            0.5 * a0,
            (20.0 * delta - (8.0 * v1 + 12.0 * v0) * T - (3.0 * a0 - a1) * T**2) / (2.0 * T**3),
            (-30.0 * delta + (14.0 * v1 + 16.0 * v0) * T + (3.0 * a0 - 2.0 * a1) * T**2)
            / (2.0 * T**4),
            (12.0 * delta - 6.0 * (v0 + v1) * T - (a0 - a1) * T**2) / (2.0 * T**5),
        ],
        axis=1,
    )[None]
