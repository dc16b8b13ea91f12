"""L-BFGS with the bisecting line search of Lewis and Overton, and the metric of a spline's control
points.

Nocedal, Updating quasi-Newton matrices with limited storage (1980); Lewis, Overton, Nonsmooth
optimization via quasi-Newton methods (2013): weak Wolfe conditions by bisection, sound where the
function has kinks.
"""

from collections.abc import Callable

import numpy as np

from ir_values.arrays import FloatArray

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
