"""Motions over pieces of time as intervals: what proofs of torque and bounds of power share.

Over a piece with middle m a smooth f lies in f(m) + f' over the piece (t - m): the mean value form,
whose excess shrinks with the square of the piece. Coulomb friction is of either sign where the
velocity may vanish, none where the joint rests through the segment.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels.dynamics_data import DynamicsData
from ir_kernels.reference import dynamics
from ir_kernels.reference.interval import Dual, Interval, intersect, interval, power, sine_cosine
from ir_kernels.reference.vectors import Number
from ir_values.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Pieces:
    """Times begin..end (K,) within the segments (K,)."""

    segment: IntArray
    begin: FloatArray
    end: FloatArray


@dataclass(frozen=True)
class Enclosure:
    """Per joint over the pieces (K,): step = t - m; speed, torque without Coulomb friction and that
    friction; at the middles, and over the pieces with their derivatives.
    """

    step: Interval
    speed0: list[Interval]
    torque0: list[Interval]
    speed: list[Dual]
    torque: list[Dual]
    coulomb: list[Interval]


def pieces_of(durations: FloatArray, counts: IntArray) -> Pieces:
    """Segments (S,) divided evenly into `counts` (S,) pieces each."""
    segment = np.repeat(np.arange(len(durations)), counts)
    k = np.concatenate([np.arange(count) for count in counts])
    width = durations / counts
    return Pieces(
        segment, k * width[segment], np.minimum((k + 1) * width[segment], durations[segment])
    )


def _horner(a: list[Interval], x: Interval) -> Interval:
    value = a[-1]
    for coefficient in reversed(a[:-1]):
        value = value * x + coefficient
    return value


def _smooth_torque(
    data: DynamicsData, sin: Number, cos: Number, qd: Number, qdd: Number
) -> list[Number]:
    tau = dynamics.rigid_body_torque(data, sin, cos, qd, qdd)
    for j in range(data.n):
        tau[j] = tau[j] + qdd[j] * float(data.rotor_inertia[j]) + qd[j] * float(data.viscous[j])
    if data.counterbalance is not None:
        j = data.counterbalance.joint
        tau[j] = tau[j] - dynamics.counterbalance_torque(
            data.counterbalance, sin[j], cos[j], lambda x: power(x, 0.5), power
        )
    return tau


def enclosure(
    data: DynamicsData, coefficients: FloatArray, rests: FloatArray, pieces: Pieces
) -> Enclosure:
    """Of coefficients (S, n, terms), `rests` (S, n) those that don't move, over pieces (K,)."""
    middle = 0.5 * (pieces.begin + pieces.end)
    step = Interval((interval(pieces.begin) - middle).lo, (interval(pieces.end) - middle).hi)
    points: list[list[Interval]] = [[], [], []]
    ranges: list[list[Interval]] = [[], [], [], []]
    for j in range(data.n):
        a = [interval(c) for c in coefficients[pieces.segment, j].T]
        for i in range(len(a) - 1):  # Taylor shift to the middle
            for k in reversed(range(i, len(a) - 1)):
                a[k] = a[k] + a[k + 1] * middle
        for order in range(4):
            ranges[order].append(_horner(a, step) if a else interval(0.0 * middle))
            if order < 3:
                points[order].append(a[0] if a else interval(0.0 * middle))
            a = [c * float(k) for k, c in enumerate(a) if k > 0]
    sin0, cos0 = zip(*(sine_cosine(q) for q in points[0]), strict=True)
    at_middle = _smooth_torque(data, sin0, cos0, points[1], points[2])
    both = [sine_cosine(q) for q in ranges[0]]
    speed = [Dual(v, a) for v, a in zip(ranges[1], ranges[2], strict=True)]
    over = _smooth_torque(
        data,
        [Dual(s, c * v) for (s, c), v in zip(both, ranges[1], strict=True)],
        [Dual(c, -(s * v)) for (s, c), v in zip(both, ranges[1], strict=True)],
        speed,
        [Dual(a, jerk) for a, jerk in zip(ranges[2], ranges[3], strict=True)],
    )
    torque = [
        Dual(intersect(t.v, t0 + t.d * step), t.d) for t, t0 in zip(over, at_middle, strict=True)
    ]
    friction = []
    for j, v in enumerate(ranges[1]):
        size = float(data.coulomb[j])
        still = rests[pieces.segment, j]
        least = np.where(still, 0.0, np.where(v.lo > 0.0, size, -size))
        friction.append(Interval(least, np.where(still, 0.0, np.where(v.hi < 0.0, -size, size))))
    return Enclosure(step, points[1], at_middle, speed, torque, friction)
