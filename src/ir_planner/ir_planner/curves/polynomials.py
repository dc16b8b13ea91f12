"""Polynomials of a trajectory: exact extremes between its points, and samples at many instants.

A trajectory is q(t) = sum_k c_k t^k in the local time of each segment, coefficients (S, n, K).
Limits are compared with extremes, which the compiled core finds. The travel of a joint is the
distance between its ends, or where it turns in between, that between its turning points: they are
bracketed between the roots of the next derivative, down to a line, so none is missed and no
sampling takes part.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ir_kernels import portable
from ir_kernels.limits import Extrema, polynomial_extrema, polynomial_samples
from ir_msgs_py.trajectory import JointTrajectory, MotionSamples
from ir_values.arrays import BoolArray, FloatArray

# rad: what higher powers may add to a cubic, as a point per knot of a spline rounds them
_NOTHING = 1e-9
_HALVINGS = 15  # a root to 3e-5 of the segment: the value at an extreme is off by its square


@dataclass(frozen=True, eq=False)
class Extremes:
    """Largest values per segment and joint, each (S, n): rad, rad/s, rad/s^2, rad/s^3.

    positions (S, n, K): polynomials over the share of their segment; turning (S, n): where a joint
    turns.
    """

    lowest: FloatArray
    highest: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    positions: FloatArray
    turning: BoolArray

    @cached_property
    def travel(self) -> FloatArray:
        """Sum |dq| (S, n) rad; found when it is asked for, because it costs more than all the
        others.
        """
        travel = np.abs(self.positions[:, :, 1:].sum(axis=2))
        if self.turning.any():
            turning = self.positions[self.turning]
            cubic = np.abs(turning[:, 4:]).sum(axis=1) <= _NOTHING
            found = np.empty(len(turning))
            found[cubic] = _cubic_travel(turning[cubic])
            if not cubic.all():
                found[~cubic] = _turning_travel(turning[~cubic])
            travel[self.turning] = found
        return np.asarray(travel)


def evaluate(polynomial: FloatArray, u: FloatArray) -> FloatArray:
    """Values (P, M) of polynomials (P, k+1), lowest power first, at u (P, M)."""
    value = np.broadcast_to(polynomial[:, -1:], u.shape).copy()
    for k in range(polynomial.shape[1] - 2, -1, -1):
        value *= u
        value += polynomial[:, k : k + 1]
    return value


def derivative(polynomial: FloatArray) -> FloatArray:
    """Derivatives (P, k) of polynomials (P, k+1)."""
    return polynomial[:, 1:] * np.arange(1, polynomial.shape[1])


def roots_between(polynomial: FloatArray, turning: FloatArray) -> FloatArray:
    """Roots in [0, 1] of polynomials (P, k+1), given points (P, k-1) that hold the roots of their
    derivatives.

    Returns (P, k), ascending; where a piece has no root, one of its ends stands in.
    """
    rows = len(polynomial)
    edges = np.concatenate([np.zeros((rows, 1)), turning, np.ones((rows, 1))], axis=1)
    low = edges[:, :-1].copy()
    high = edges[:, 1:].copy()
    value = evaluate(polynomial, edges)
    sign_low = np.sign(value[:, :-1])
    crossing = sign_low * np.sign(value[:, 1:]) < 0
    high = np.where(crossing, high, low)
    if not crossing.any():
        return low
    active = np.flatnonzero(crossing.any(axis=1))
    part = polynomial[active]
    lo = low[active]
    hi = high[active]
    sign = sign_low[active]
    for _ in range(_HALVINGS):
        middle = 0.5 * (lo + hi)
        left = np.sign(evaluate(part, middle)) == sign
        lo = np.where(left, middle, lo)
        hi = np.where(left, hi, middle)
    low[active] = 0.5 * (lo + hi)
    return low


def extremes(coefficients: FloatArray, durations: FloatArray) -> Extremes:
    """Extremes of the trajectory with `coefficients` (S, n, K) and `durations` (S,) s."""
    if len(durations) == 0:
        nothing = np.zeros(coefficients.shape[:2])
        still = nothing.astype(np.bool_)
        return Extremes(nothing, nothing, nothing, nothing, nothing, coefficients, still)
    position, speed, change, jerk = (
        polynomial_extrema(coefficients, durations, k) for k in range(4)
    )
    return Extremes(
        lowest=position.minimum,
        highest=position.maximum,
        velocity=_size(speed),
        acceleration=_size(change),
        jerk=_size(jerk),
        positions=coefficients
        * portable.power(durations[:, None, None], np.arange(coefficients.shape[2])),
        turning=(speed.minimum < 0.0) & (speed.maximum > 0.0),
    )


def _size(found: Extrema) -> FloatArray:
    return np.asarray(np.maximum(np.abs(found.minimum), np.abs(found.maximum)))


def _cubic_travel(position: FloatArray) -> FloatArray:
    """Travel (P,) of polynomials (P, K) over u in [0, 1] that are cubic, or less."""
    c = np.zeros((4, len(position)))
    c[: min(position.shape[1], 4)] = position[:, :4].T
    # of the speed a u^2 + 2 half u + b
    a = 3.0 * c[3]
    half = c[2]
    b = c[1]
    root = np.sqrt(np.maximum(half * half - a * b, 0.0))
    larger = -(half + np.copysign(root, half))  # without cancellation
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.stack([np.zeros_like(a), larger / a, b / larger, np.ones_like(a)])
    turns = np.sort(np.clip(np.where(np.isfinite(turns), turns, 0.0), 0.0, 1.0), axis=0)
    along = ((c[3] * turns + c[2]) * turns + c[1]) * turns
    return np.asarray(np.abs(np.diff(along, axis=0)).sum(axis=0))


def _turning_travel(position: FloatArray) -> FloatArray:
    """Travel (P,) there and back of polynomials (P, K) over u in [0, 1]."""
    chain = [position]
    for _ in range(position.shape[1] - 2):
        chain.append(derivative(chain[-1]))
    line = chain[-1]  # its root in closed form
    root = np.divide(-line[:, 0], line[:, 1], out=np.zeros(len(line)), where=line[:, 1] != 0.0)
    points = np.clip(root, 0.0, 1.0)[:, None]
    for order in range(len(chain) - 2, 0, -1):
        points = roots_between(chain[order], points)
    along = evaluate(position, _with_ends(points))
    return np.asarray(np.abs(np.diff(along, axis=1)).sum(axis=1))


def _with_ends(points: FloatArray) -> FloatArray:
    rows = len(points)
    return np.concatenate([np.zeros((rows, 1)), points, np.ones((rows, 1))], axis=1)


def motion_at(trajectory: JointTrajectory, times: NDArray[np.floating]) -> MotionSamples:
    """q, qd, qdd (M, n) at times (M,) s within the trajectory; jerk (0, n) is left out."""
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        return trajectory.sample(times)
    found = polynomial_samples(coefficients, durations, trajectory.times[:-1], times)
    return MotionSamples(*found, np.zeros((0, coefficients.shape[1])))
