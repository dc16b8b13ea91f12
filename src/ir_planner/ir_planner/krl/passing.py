"""When a PTP_SPLINE passes its points: near the planned times as far as the limits allow.

A spline through points of a planned movement overshoots where the plan's jerk steps from one limit
to the other, so that at the planned times it exceeds them. A sequence of linear programs changes
the times between
points, by a piecewise linear slowness over the movement: within the limits, not longer than planned
where that can be, with the least changes.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import linprog

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_planner.scene import PlanningScene, torque_use

_DEGREE = 5
_KNOTS_MAX = 32  # of the slowness
_PER_INTERVAL = 6  # samples between two points, where limits are looked at
_ROUNDS = 12
_TRUST = (0.1, 0.002)  # of the logarithm of the slowness in one round: at first, at least
_NEAR = 0.7  # of a limit: samples below take no part in a linear program
_USED = 0.996  # of a limit at samples: between them a little more is needed
_STEP = 1e-5  # of a difference quotient
_MISSED = 100.0  # cost of what exceeds a limit, in durations: far above what it could save
_CHANGED = 0.01  # cost of a slowness on average: small, so that durations decide


def resting_spline(times: FloatArray, points: FloatArray) -> BSpline:
    """The spline of degree five through points (M, n) at times (M,) s, at rest at both ends."""
    still = np.zeros(points.shape[1])
    rest = (still, still)
    return portable.interpolating_spline(times, points, _DEGREE, ends=(rest, rest))


@dataclass(frozen=True, eq=False)
class _Problem:
    """points (M + 1, n) at times that follow from steps (M,) s and what basis (M, K) makes of a
    slowness.
    """

    points: FloatArray
    steps: FloatArray
    basis: FloatArray
    scene: PlanningScene

    def lasting(self, slowness: FloatArray) -> FloatArray:
        """Seconds (M,) between points, with a logarithm of the slowness (K,)."""
        return np.asarray(self.steps * portable.exp(portable.matmul(self.basis, slowness)))

    def used(self, slowness: FloatArray) -> FloatArray:
        """Shares (R,) of the limits at samples."""
        lasting = self.lasting(slowness)
        times = np.concatenate([[0.0], np.cumsum(lasting)])
        spline = resting_spline(times, self.points)
        inner = (np.arange(_PER_INTERVAL) / _PER_INTERVAL)[None, :] * lasting[:, None]
        at = np.append((times[:-1, None] + inner).ravel(), times[-1])
        q, qd, qdd, qddd = (np.asarray(spline(at, nu=k)) for k in range(4))
        limits = self.scene.limits
        torque = torque_use(self.scene.dynamics, q, qd, qdd) / limits.torque_share
        shares = (qd / limits.velocity, qdd / limits.acceleration, qddd / limits.jerk, torque)
        return np.concatenate([np.abs(share).ravel() for share in shares])


def passing_times(points: FloatArray, times: FloatArray, scene: PlanningScene) -> FloatArray:
    """Times (M,) s at which points (M, n) are passed within the limits, from those that were
    planned.
    """
    steps = np.diff(times)
    problem = _Problem(points, steps, _hats(len(steps)), scene)
    slowness = np.zeros(problem.basis.shape[1])
    used = problem.used(slowness)
    trust = _TRUST[0]
    for _ in range(_ROUNDS):
        change = _change(problem, slowness, used, trust)
        trial = problem.used(slowness + change)
        if _cost(problem, slowness + change, trial) < _cost(problem, slowness, used):
            slowness = slowness + change
            used = trial
            if np.abs(change).max() < _TRUST[1]:
                break
        else:
            trust *= 0.3
            if trust < _TRUST[1]:
                break
    return np.concatenate([times[:1], times[0] + np.cumsum(problem.lasting(slowness))])


def _cost(problem: _Problem, slowness: FloatArray, used: FloatArray) -> float:
    longer = problem.lasting(slowness).sum() / problem.steps.sum() - 1.0
    changed = _CHANGED * float(np.abs(slowness).mean())
    return float(max(longer, 0.0) + changed + _MISSED * max(used.max() - _USED, 0.0))


def _change(problem: _Problem, slowness: FloatArray, used: FloatArray, trust: float) -> FloatArray:
    """The change (K,) of the slowness that a linear program finds.

    Its variables are the change, the sizes of the slowness, what limits are exceeded by, and by
    what share the movement is longer than planned.
    """
    rows = np.flatnonzero(used > _NEAR)
    count = len(slowness)
    slopes = np.empty((len(rows), count))
    for k, beside in enumerate(slowness + _STEP * np.eye(count)):
        slopes[:, k] = (problem.used(beside)[rows] - used[rows]) / _STEP
    planned = problem.steps.sum()
    lasting = problem.lasting(slowness)
    one = np.eye(count)
    none = np.zeros((count, 1))
    limits = np.column_stack(
        [slopes, np.zeros_like(slopes), -np.ones(len(rows)), np.zeros(len(rows))]
    )
    longer = np.concatenate(
        [portable.matmul(lasting, problem.basis) / planned, np.zeros(count), [0.0, -1.0]]
    )
    above, below = (np.column_stack([sign * one, -one, none, none]) for sign in (1.0, -1.0))
    found = linprog(
        np.concatenate([np.zeros(count), np.full(count, _CHANGED / count), [_MISSED, 1.0]]),
        A_ub=np.vstack([limits, longer, above, below]),
        b_ub=np.concatenate(
            [_USED - used[rows], [1.0 - lasting.sum() / planned], -slowness, slowness]
        ),
        bounds=[*[(-trust, trust)] * count, *[(0.0, None)] * (count + 2)],
        method="highs",
    )
    return np.zeros(count) if found.x is None else np.asarray(found.x[:count])


def _hats(intervals: int) -> FloatArray:
    """What each of at most _KNOTS_MAX knots contributes to each interval (M, K)."""
    knots = np.linspace(0.0, 1.0, min(intervals, _KNOTS_MAX))
    middle = (np.arange(intervals) + 0.5) / intervals
    if len(knots) == intervals:
        return np.eye(intervals)
    return np.column_stack([np.interp(middle, knots, one) for one in np.eye(len(knots))])
