"""The descent on the speed profile along a fixed path: the oracle of the compiled one.

A spline passes p(s) at its inner knots; s and the logarithm of the duration change, each in its
scale.
"""

from typing import Any

import numpy as np

from ir_kernels.reference.descent import descend
from ir_values.arrays import FloatArray

BENDING = 0.03  # weight of the jerk of s in the metric
# of s, and of the duration's logarithm
SCALE = 0.03
TIME = 0.1


def along(breaks: FloatArray, cubics: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """p (C, n) and its derivative at s (C,)."""
    k = np.clip(np.searchsorted(breaks, s, side="right") - 1, 0, cubics.shape[1] - 1)
    u = (s - breaks[k])[:, None]
    a, b, c, d = cubics[:, k]
    return a + u * (b + u * (c + u * d)), b + u * (2.0 * c + 3.0 * u * d)


class ProfileCost:
    """Cost of the splines that pass a path (breaks, cubics) at s (C,) + SCALE x at their inner
    knots, of `duration` s times exp(TIME x), by a core's `value`.
    """

    def __init__(
        self,
        core: Any,
        path: tuple[FloatArray, FloatArray],
        s: FloatArray,
        duration: float,
        fixed: bool,
    ) -> None:
        count = len(s)
        self.core = core
        self.path = path
        self.s = s
        self.duration = duration
        self.fixed = fixed
        self.knots = 4.0 * np.eye(count) + np.eye(count, k=1) + np.eye(count, k=-1)
        self.ends = along(*path, np.array([0.0, 1.0]))[0]

    def at(self, x: FloatArray) -> tuple[FloatArray, float]:
        """s (C,) and duration [s] at x (C + 1,)."""
        return np.clip(self.s + SCALE * x[:-1], 0.0, 1.0), self.duration * float(
            np.exp(TIME * x[-1])
        )

    def value(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Cost and its gradient (C + 1,)."""
        (s, duration), ends = self.at(x), self.ends
        q, slope = along(*self.path, s)
        right = 6.0 * q
        right[0] -= ends[0]
        right[-1] -= ends[1]
        inner = np.linalg.solve(self.knots, right)
        interval = duration / (len(s) + 3)
        control = np.concatenate(
            [np.repeat(ends[:1], 3, axis=0), inner, np.repeat(ends[1:], 3, axis=0)]
        )
        row = np.zeros(len(s) + 3, np.int32)
        cost, gradient, of_interval, _ = self.core.value(control, row, interval)
        by_s = 6.0 * SCALE * (np.linalg.solve(self.knots, gradient[3:-3]) * slope).sum(axis=1)
        return cost, np.append(by_s, 0.0 if self.fixed else TIME * of_interval * interval)


def descend_profile(
    core: Any,
    path: tuple[FloatArray, FloatArray],
    s: FloatArray,
    duration: float,
    fixed: bool,
    most: int,
    tolerance: float,
) -> tuple[FloatArray, float, float, int]:
    """New s (C,), duration, value, evaluations, by a core's `value`; path: breaks and cubics."""
    cost = ProfileCost(core, path, s, duration, fixed)
    third = np.diff(np.eye(len(s)), 3, axis=0)
    metric = np.eye(len(s)) + BENDING * (len(s) + 3) ** 3 * third.T @ third

    def solve(v: FloatArray) -> FloatArray:
        return np.append(np.linalg.solve(metric, v[:-1]), v[-1])

    x, value, used = descend(np.zeros(len(s) + 1), cost.value, solve, most, tolerance)
    return *cost.at(x), value, used
