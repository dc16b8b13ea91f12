"""A path p(s) that stays as it is: the configurations that a trajectory passes, at any speed
profile.
"""

import numpy as np
from numpy.typing import NDArray

from ir_kernels import CubicPath, portable
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import UniformSpline
from ir_values.arrays import FloatArray

_PLACES = 2000  # of the path, between which it is interpolated
_STANDING = 0.001  # share of the mean speed by which places part where the given motion stands
_APART = (
    0.3  # of the distance between places: what is nearer to a point of the trajectory is left out
)
_SAME = 1e-9  # rad
_FIRST = 0.125  # of the second control point's rise: the least of the first; 0.25 with an even jerk
_NEAREST = 8  # samples per interval for the deviation


class FixedPath:
    """p(s), s in [0, 1], from the points (N, n) that a trajectory passes."""

    def __init__(self, given: JointTrajectory, points: FloatArray) -> None:
        begin = float(given.times[0])
        span = given.duration - float(given.times[0])
        self.duration = span
        knots = (given.times - begin) / span
        places = np.linspace(0.0, 1.0, _PLACES)
        near = np.abs(knots[np.clip(np.searchsorted(knots, places), 1, len(knots) - 1)] - places)
        near = np.minimum(
            near, np.abs(knots[np.clip(np.searchsorted(knots, places) - 1, 0, None)] - places)
        )
        self._share = np.sort(np.concatenate([knots, places[near > _APART / _PLACES]]))
        motion = given.sample(begin + self._share * span)
        q = motion.q
        q[0] = given.positions[0]
        q[-1] = given.positions[-1]
        speed = np.linalg.norm(motion.qd, axis=1)
        density = speed + _STANDING * speed.mean()
        middle = 0.5 * (density[1:] + density[:-1])
        s = np.concatenate([[0.0], np.cumsum(middle * np.diff(self._share))])
        self._s = s / s[-1]
        self.q = q
        spline = portable.interpolating_spline(self._s, q)
        breaks = np.unique(spline.t)
        begins = breaks[:-1]
        cubics = [spline(begins), spline(begins, 1), spline(begins, 2) / 2, spline(begins, 3) / 6]
        self.cubics = CubicPath(breaks, np.stack(cubics))
        self._passed = np.interp(knots[_in_order(given.positions, points)], self._share, self._s)

    def at(self, s: FloatArray) -> FloatArray:
        """p (N, n) rad at s (N,) in [0, 1]."""
        breaks = self.cubics.breaks
        k = np.clip(np.searchsorted(breaks, s, side="right") - 1, 0, len(breaks) - 2)
        u = (s - breaks[k])[:, None]
        a, b, c, d = self.cubics.cubics[:, k]
        return np.asarray(a + u * (b + u * (c + u * d)))

    def places(self, count: int) -> FloatArray:
        """s at the inner knots (count - 3,) with the speed profile that was given."""
        return np.asarray(np.interp(np.linspace(0.0, 1.0, count + 1)[2:-2], self._share, self._s))

    def finer(self, s: FloatArray) -> FloatArray:
        """The same speed profile with a knot more in every interval."""
        knots = np.concatenate([[0.0], np.arange(2.0, len(s) + 2.0), [len(s) + 3.0]])
        profile = portable.interpolating_spline(knots, np.concatenate([[0.0], s, [1.0]]))
        return np.clip(profile(np.arange(2.0, 2.0 * len(s) + 5.0) / 2.0), 0.0, 1.0)

    def knots_at_points(self, s: FloatArray) -> FloatArray:
        """Where inner points are passed, in knots from the beginning (M - 2,); s (C,) at the inner
        knots.
        """
        rising = np.concatenate([[0.0], np.maximum.accumulate(s), [1.0]])
        knots = np.concatenate([[0.0], np.arange(2.0, len(s) + 2.0), [len(s) + 3.0]])
        return np.asarray(np.interp(self._passed[1:-1], rising, knots))

    def spline(self, s: FloatArray, duration: float) -> UniformSpline:
        """The spline that passes p(s) at its inner knots, at rest at both ends."""
        inner = self.at(s)
        right = 6.0 * inner
        right[0] -= self.q[0]
        right[-1] -= self.q[-1]
        control = np.empty((len(inner) + 6, inner.shape[1]))
        control[:3] = self.q[0]
        control[-3:] = self.q[-1]
        control[3:-3] = from_knots(right)
        return UniformSpline(control, duration / (len(inner) + 3))

    def deviation(self, spline: UniformSpline, s: FloatArray) -> float:
        """Largest distance of the spline from the path [rad]: to its nearest configuration within
        two knots.
        """
        q = spline.samples(_NEAREST)[0]
        around = np.concatenate(
            [[0.0, 0.0], np.maximum.accumulate(np.clip(s, 0.0, 1.0)), [1.0, 1.0]]
        )
        k = np.arange(len(around) - 1)
        first = around[np.maximum(k - 1, 0)]
        last = around[np.minimum(k + 2, len(around) - 1)]
        near = self.at(np.linspace(first, last, 16 * _NEAREST, axis=1).ravel())
        near = near.reshape(len(k), 1, 16 * _NEAREST, -1)
        mine = q[: len(k) * _NEAREST].reshape(len(k), _NEAREST, 1, -1)
        away = np.zeros(1)
        for joint in range(
            q.shape[1]
        ):  # the largest of all joints, without an array of all of them
            away = np.maximum(away, np.abs(mine[..., joint] - near[..., joint]))
        return float(away.min(axis=2).max())


def from_knots(right: FloatArray) -> FloatArray:
    """The control points (C, n) whose values at their knots, times 6, are `right` (C, n); the
    matrix is symmetric.
    """
    bands = np.ones((2, len(right)))
    bands[1] = 4.0
    return portable.solve_banded(bands, right)


def never_back(s: FloatArray) -> FloatArray:
    """s (C,) at the inner knots of a spline over s from 0 to 1 that nowhere falls: as given where
    that is so, else with control points that rise, from the first interval on.
    """
    right = 6.0 * s
    right[-1] -= 1.0
    control = from_knots(right[:, None])[:, 0]
    rising = np.concatenate([[0.0], np.maximum.accumulate(np.clip(control, 0.0, 1.0)), [1.0]])
    if np.array_equal(rising[1:-1], control):
        return s
    rising[1] = max(rising[1], _FIRST * rising[2])
    rising[-2] = min(rising[-2], 1.0 - _FIRST * (1.0 - rising[-3]))
    return np.asarray((rising[:-2] + 4.0 * rising[1:-1] + rising[2:]) / 6.0)


def _in_order(positions: FloatArray, points: FloatArray) -> NDArray[np.int64]:
    """Indices (M,) at which `points` (M, n) are among `positions` (N, n), each after the one
    before; of a point that isn't among them that of the nearest one, which leaves some for the
    points after it.
    """
    found = [0]
    for k, point in enumerate(points[1:-1], start=1):
        first = min(found[-1] + 1, len(positions) - 1)
        away = np.abs(
            positions[first : max(len(positions) - len(points) + 1 + k, first + 1)] - point
        )
        here = np.flatnonzero(away.max(axis=1) < _SAME)
        found.append(first + int(here[0] if len(here) else np.argmin(away.max(axis=1))))
    return np.array([*found, len(positions) - 1])
