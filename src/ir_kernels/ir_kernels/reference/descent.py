"""L-BFGS with the bisecting line search of Lewis and Overton, and the metric of a spline's control
points.

Nocedal, Updating quasi-Newton matrices with limited storage (1980); Lewis, Overton, Nonsmooth
optimization via quasi-Newton methods (2013): weak Wolfe conditions by bisection, sound where the
function has kinks.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ir_kernels.spline_terms import SplineTerms
from ir_values.arrays import FloatArray, IntArray

MEMORY = 16  # pairs of steps and changes of the gradient
PATIENCE = 10  # iterations that have to gain something together
TRIES = 12  # of one line search
# Wolfe's constants
SUFFICIENT = 1e-4
FLATTER = 0.9
BLIND = 0.1  # factor of a step that is too long, while nothing is known of the scale
FIRST_STEP = 0.3  # at most, in every coordinate, while nothing is known of the curvature

Function = Callable[[FloatArray], tuple[float, FloatArray]]
Solve = Callable[[FloatArray], FloatArray]
Pairs = list[tuple[FloatArray, FloatArray]]
Point = tuple[FloatArray, float, FloatArray]  # x, value, gradient


def bending_metric(m: int, holding: float) -> FloatArray:
    """(m, m): D'D + holding, D the second differences of m inner control points between fixed
    ends.
    """
    second = -2.0 * np.eye(m) + np.eye(m, k=1) + np.eye(m, k=-1)
    metric: FloatArray = second.T @ second + holding * np.eye(m)
    return metric


def direction(gradient: FloatArray, pairs: Pairs, solve: Solve) -> FloatArray:
    """H gradient, H the inverse Hessian that `pairs` (s, y) make of M^-1, scaled by the newest of
    them.
    """
    d = gradient.copy()
    alphas = []
    for s, y in reversed(pairs):
        alphas.append(float(s @ d / (s @ y)))
        d -= alphas[-1] * y
    d = solve(d)
    if pairs:
        s, y = pairs[-1]
        d *= float(s @ y) / float(y @ solve(y))
    for (s, y), alpha in zip(pairs, reversed(alphas), strict=True):
        d += (alpha - float(y @ d / (s @ y))) * s
    return d


def line_search(
    function: Function,
    at: tuple[FloatArray, float, FloatArray, float],
    step: float,
    tries: int,
    shorten: float = 0.5,
) -> tuple[Point | None, int]:
    """The best step found from x (N,) along -d that gains enough, or None; and the evaluations it
    took.

    at: x, the value there, d (N,), the slope along -d. shorten: factor of the step until one gains
    enough.
    """
    x, value, d, slope = at
    low = 0.0
    high = np.inf
    kept = None
    used = 0
    while used < tries:
        there = x - step * d
        at_step, by_step = function(there)
        used += 1
        if not at_step <= value + SUFFICIENT * step * slope:
            high = step
            if kept is not None:
                break
        else:
            low = step
            kept = (there, at_step, by_step)
            if -float(by_step @ d) >= FLATTER * slope:
                break
        shorter = shorten * high if kept is None else 0.5 * (low + high)
        step = 2.0 * low if np.isinf(high) else shorter
    return kept, used


def descend(
    x: FloatArray, function: Function, solve: Solve, evaluations: int, tolerance: float
) -> tuple[FloatArray, float, int]:
    """Where the descent from `x` (N,) ends, the value there, and how many evaluations it took.

    function(x): value and gradient; solve(v): M^-1 v, M positive definite and near the Hessian.
    Ends after `evaluations`, when PATIENCE iterations gain less than `tolerance` of the value, or
    where no direction leads down.
    """
    value, gradient = function(x)
    pairs: Pairs = []
    used = 1
    history = [value]
    while used < evaluations:
        d = direction(gradient, pairs, solve)
        slope = -float(gradient @ d)
        if not slope < 0.0:  # only rounding can lead here: start again from the steepest direction
            if not pairs:
                break
            pairs = []
            continue
        step = 1.0 if pairs else min(1.0, FIRST_STEP / max(float(np.abs(d).max()), 1e-12))
        tries = min(TRIES, evaluations - used)
        shorten = 0.5 if pairs else BLIND
        kept, tried = line_search(function, (x, value, d, slope), step, tries, shorten)
        used += tried
        if kept is None:
            if not pairs:
                break
            pairs = []
            continue
        s = kept[0] - x
        y = kept[2] - gradient
        x, value, gradient = kept
        if s @ y > 1e-12 * np.sqrt((s @ s) * (y @ y)):
            pairs = [*pairs[-(MEMORY - 1) :], (s, y)]
        history.append(value)
        if len(history) > PATIENCE and history[-1 - PATIENCE] - value < tolerance * abs(value):
            break
    return x, value, used


# The descent on the speed profile along a fixed path: the oracle of the compiled one.
#
# A spline passes p(s) at its inner knots; s and the logarithm of the duration change, each in its
# scale.

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
        s, duration = self.at(x)
        ends = self.ends
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


# Splines from rest to rest along given points, and descents that start from them.


def fewest_seconds(path: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> float:
    """A guess that is seldom too long: a path (M, n) at full speed, or from rest to rest as its
    longest joint.
    """
    steps = np.abs(np.diff(path, axis=0))
    at_speed = float((steps / velocity).max(axis=1).sum())
    return max(at_speed, 2.0 * float(np.sqrt((steps.sum(axis=0) / acceleration).max())))


def spline_along(
    path: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    settings: tuple[float, float, float, int, int],
) -> tuple[FloatArray, float]:
    """Control points (K, n) and interval along a path (M, n), by its length and slowly at both
    ends;
    settings: spacing, slower, duration, fewest, most.
    """
    spacing, slower, duration, fewest, most = settings
    least = fewest_seconds(path, velocity, acceleration)
    count = int(np.clip(np.ceil(least / spacing), fewest, most))
    share = np.arange(1, count + 1) / (count + 1)
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = share * share * (3.0 - 2.0 * share) * passed[-1]
    inner = np.stack([np.interp(at, passed, joint) for joint in path.T], axis=1)
    control = np.concatenate(
        [np.repeat(path[:1], 3, axis=0), inner, np.repeat(path[-1:], 3, axis=0)]
    )
    return control, (duration or slower * least) / (count + 3)


def descend_along(
    core: Any,
    terms: SplineTerms,
    points: FloatArray,
    counts: IntArray,
    settings: tuple[float, float, float, int, int],
    evaluations: int,
    tolerance: float,
) -> list[tuple[FloatArray, float, float, int]]:
    """What a core's `descend` returns, from starts along paths: points (P, n) one path after the
    other, counts (L,) of them.
    """
    found = []
    for path in np.split(points, np.cumsum(counts)[:-1]):
        control, interval = spline_along(path, terms.velocity, terms.acceleration, settings)
        row = np.zeros(len(control) - 3, np.int32)
        fixed = settings[2] > 0.0
        at_rest = np.zeros(0)
        control, *ended = core.descend(
            control, row, interval, fixed, evaluations, tolerance, at_rest
        )
        found.append((np.clip(control, terms.low, terms.high), *ended))
    return found
