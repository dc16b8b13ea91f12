"""The descent on the speed profile along a fixed path: s at the knots of a uniform spline; its duration."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs
from scipy.optimize import Bounds, OptimizeResult, minimize

from ir_kernels import SplineCost
from ir_msgs_py.arrays import FloatArray
from ir_planner.optimize.fixed_path import FixedPath, from_knots
from ir_planner.optimize.passing import jerk_bands
from ir_planner.optimize.terms import spline_cost
from ir_planner.request import Context
from ir_planner.scene import MotionLimits
from ir_planner.timing import objective_weights

Function = Callable[[Any], tuple[float, FloatArray]]  # Any: SciPy hands over vectors of its own type
_SPARSE = 40  # places of the path for the weight of an objective
_MEMORY = 16  # pairs of L-BFGS: more of them gain nothing here
_PATIENCE, _GAIN = 10, 1e-5  # so many steps must gain so much of the value together
_BENDING = 0.03  # weight of the jerk of s in the metric
_S, _TIME = 0.03, 0.1  # scales of s and of the duration's logarithm
_FARTHEST = 10.0  # scales of s, and of the logarithm of the duration, in one descent


def optimised_profile(
    path: FixedPath,
    s: FloatArray,
    duration: float,
    limits: MotionLimits,
    effort: tuple[float, float, int],
    context: Context,
) -> tuple[FloatArray, float, int]:
    """s (count - 3,) at the inner knots, duration [s] and evaluations, from a profile s and its duration,
    which stays where the request has one. effort: stiffness of penalties, against the power that the
    objective is about, smoothing of the bus [W], and evaluations.
    """
    descent = _Descent(path, s, duration, context.options.duration > 0.0)
    weights = objective_weights(context, path.q[::_SPARSE])
    stiffness, smoothing, most = effort
    cost = spline_cost(context, limits, weights, stiffness * weights.power, smoothing=smoothing)
    x, evaluations = _minimised(lambda x: descent.value(x, cost), np.zeros(len(s) + 1), most)
    return *descent.at(x), evaluations


def _minimised(function: Function, x: FloatArray, most: int) -> tuple[FloatArray, int]:
    """The lowest point (N,) that L-BFGS-B finds from x (N,) in at most so many evaluations, and their
    number.
    """
    values: list[float] = []

    def gains(intermediate_result: OptimizeResult) -> None:
        values.append(float(intermediate_result.fun))
        if len(values) > _PATIENCE and values[-1 - _PATIENCE] - values[-1] < _GAIN * abs(values[-1]):
            raise StopIteration

    found = minimize(
        function,
        x,
        jac=True,
        method="L-BFGS-B",
        bounds=Bounds(-_FARTHEST, _FARTHEST),  # a first step may overshoot
        callback=gains,
        options={
            "maxcor": _MEMORY,
            "maxfun": most,
            "maxiter": most,
            "ftol": 0.0,
            "gtol": 0.0,
        },
    )
    return np.asarray(found.x), int(found.nfev)


class _Descent:
    """What is minimised, by x (C + 1,): the change of s in a metric in which its jerk counts, and the
    logarithm of the duration.
    """

    def __init__(self, path: FixedPath, s: FloatArray, duration: float, fixed: bool) -> None:
        self.path, self.s, self.duration, self.fixed = path, s, duration, fixed
        self.root = _metric_root(len(s))

    def at(self, x: FloatArray) -> tuple[FloatArray, float]:
        """s (C,) and duration [s]."""
        s = self.s + _S * dtbtrs(self.root, x[:-1])[0]
        return np.clip(s, 0.0, 1.0), self.duration * float(np.exp(_TIME * x[-1]))

    def value(self, x: FloatArray, cost: SplineCost) -> tuple[float, FloatArray]:
        """Cost and its gradient (C + 1,)."""
        s, duration = self.at(x)
        q, slope = self.path.at(s)
        spline = self.path.spline_over(q, duration)
        found = cost.value(spline.control, spline.interval)
        by_s = 6.0 * (from_knots(found.gradient[3:-3]) * slope).sum(axis=1)
        gradient = np.empty_like(x)
        gradient[:-1] = _S * dtbtrs(self.root, by_s, trans="T")[0]
        gradient[-1] = 0.0 if self.fixed else _TIME * duration * found.of_interval / spline.intervals
        return found.value, gradient


@lru_cache(maxsize=64)
def _metric_root(count: int) -> FloatArray:
    """U (4, count) in banded form, upper, with U' U = 1 + weight D' D, D the third differences of s."""
    weight = _BENDING * (count + 3) ** 3
    return np.asarray(cholesky_banded(jerk_bands(count, weight, 1.0)))
