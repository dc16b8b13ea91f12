"""Motions over pieces of time as intervals: what proofs of torque and bounds of power share.

Over a piece with middle m a smooth f lies in f(m) + f' over the piece (t - m): the mean value form,
whose excess shrinks with the square of the piece. Coulomb friction is of either sign where the
velocity may vanish, none where the joint rests through the segment.
"""

from typing import NamedTuple

import numpy as np

from ir_kernels.dynamics_data import DynamicsData
from ir_kernels.reference import dynamics
from ir_kernels.reference.interval import (
    OUTWARD,
    Dual,
    Interval,
    Number,
    intersect,
    interval,
    power,
    sine_cosine,
)
from ir_kernels.reference.limits import derivative, evaluate
from ir_values.arrays import BoolArray, FloatArray, IntArray


class Pieces(NamedTuple):
    """Times begin..end (K,) within the segments (K,)."""

    segment: IntArray
    begin: FloatArray
    end: FloatArray


class Enclosure(NamedTuple):
    """Per motor over the pieces (K,): step = t - m; speed, torque without Coulomb friction and that
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


def resting(data: DynamicsData, coefficients: FloatArray) -> BoolArray:
    """Motors (S, n) that don't move in a segment: none of the joints that they turn with does."""
    moves = (coefficients[:, :, 1:] != 0.0).any(axis=2)
    return np.asarray(~(moves[:, None, :] & (data.coupling.turns != 0.0)).any(axis=2))


def _horner(a: list[Interval], x: Interval) -> Interval:
    value = a[-1]
    for coefficient in reversed(a[:-1]):
        value = value * x + coefficient
    return value


def _smooth_torque(
    data: DynamicsData, sin: Number, cos: Number, qd: Number, qdd: Number
) -> tuple[list[Number], list[Number]]:
    """Torques without Coulomb friction, and speeds, of the motors."""
    tau = dynamics.rigid_body_torque(data, sin, cos, qd, qdd)
    if data.counterbalance is not None:
        j = data.counterbalance.joint
        tau[j] = tau[j] - dynamics.counterbalance_torque(
            data.counterbalance, sin[j], cos[j], lambda x: power(x, 0.5), power
        )
    coupling = data.coupling
    if coupling.coupled:
        tau = dynamics.combined(coupling.inverse.T, tau)
        qd, qdd = (dynamics.combined(coupling.turns, each) for each in (qd, qdd))
    for j in range(data.n):
        tau[j] = tau[j] + qdd[j] * float(data.rotor_inertia[j]) + qd[j] * float(data.viscous[j])
    return tau, list(qd)


def enclosure(
    data: DynamicsData, coefficients: FloatArray, rests: BoolArray, pieces: Pieces
) -> Enclosure:
    """Speeds and torques of the motors over each of the pieces (K,), as intervals.

    coefficients (S, n, terms): q(t) of segments by powers of their local time [s], in rad (m of a
    rail). rests (S, n): motors that stand still through a segment, which have no Coulomb friction.
    """
    middle = 0.5 * (pieces.begin + pieces.end)
    step = Interval((interval(pieces.begin) - middle).lo, (interval(pieces.end) - middle).hi)
    at_middle, over_piece = _motion_over(data.n, coefficients, pieces, middle, step)

    sines0 = []
    cosines0 = []
    for angle in at_middle[0]:
        sine, cosine = sine_cosine(angle)
        sines0.append(sine)
        cosines0.append(cosine)
    torque0, speed0 = _smooth_torque(data, sines0, cosines0, at_middle[1], at_middle[2])

    # the same over the whole piece, each quantity with its derivative by time
    angles, speeds, accelerations, jerks = over_piece
    sines = []
    cosines = []
    for angle, rate in zip(angles, speeds, strict=True):
        sine, cosine = sine_cosine(angle)
        sines.append(Dual(sine, cosine * rate))
        cosines.append(Dual(cosine, -(sine * rate)))
    qd = [Dual(value, rate) for value, rate in zip(speeds, accelerations, strict=True)]
    qdd = [Dual(value, rate) for value, rate in zip(accelerations, jerks, strict=True)]
    torque_over, speed = _smooth_torque(data, sines, cosines, qd, qdd)

    # both hold: what the piece gives directly, and the mean value form about its middle
    torque = []
    for over, centre in zip(torque_over, torque0, strict=True):
        mean_value = centre + over.d * step
        torque.append(Dual(intersect(over.v, mean_value), over.d))

    still = rests[pieces.segment]
    friction = [
        _coulomb_friction(float(data.coulomb[j]), speed[j].v, still[:, j]) for j in range(data.n)
    ]
    return Enclosure(step, speed0, torque0, speed, torque, friction)


def _motion_over(
    joints: int,
    coefficients: FloatArray,
    pieces: Pieces,
    middle: FloatArray,
    step: Interval,
) -> tuple[list[list[Interval]], list[list[Interval]]]:
    """q, qd and qdd of each joint in the middle (K,) of the pieces, and q, qd, qdd and jerk over
    the whole of them: two lists by order of the derivative, then by joint. step: t - middle [s].
    """
    at_middle: list[list[Interval]] = [[], [], []]
    over_piece: list[list[Interval]] = [[], [], [], []]
    nothing = interval(0.0 * middle)
    for j in range(joints):
        terms = [interval(term) for term in coefficients[pieces.segment, j].T]
        terms = _taylor_shifted(terms, middle)
        for order in range(4):
            over_piece[order].append(_horner(terms, step) if terms else nothing)
            if order < 3:
                at_middle[order].append(terms[0] if terms else nothing)
            terms = [term * float(k) for k, term in enumerate(terms) if k > 0]
    return at_middle, over_piece


def _taylor_shifted(terms: list[Interval], middle: FloatArray) -> list[Interval]:
    """Coefficients of the same polynomial by powers of t - middle."""
    shifted = list(terms)
    last = len(shifted) - 1
    for lowest in range(last):
        for k in reversed(range(lowest, last)):
            shifted[k] = shifted[k] + shifted[k + 1] * middle
    return shifted


def _coulomb_friction(size: float, speed: Interval, still: BoolArray) -> Interval:
    """Coulomb friction of a motor over pieces (K,): of the speed's sign where that is known, of
    either sign else, none where the motor stands still.
    """
    least = np.where(speed.lo > 0.0, size, -size)
    most = np.where(speed.hi < 0.0, -size, size)
    return Interval(np.where(still, 0.0, least), np.where(still, 0.0, most))


# A proof of the torque limits by interval arithmetic over pieces of the trajectory, halved where
# it isn't sharp.
#
# Over a piece the torque lies in its enclosure (`enclosures`).

FIRST_PIECE = 0.05  # s, longest piece to begin with
FEWEST_PIECES = 8  # of a segment to begin with
SHORTEST = 1e-7  # of a segment: pieces below this are not halved any more
REST = 1e-9  # rad/s: below, a sample lets Coulomb friction have either sign
ROUNDING_MARGIN = 1e-9  # of the limit


def least_limit(
    data: DynamicsData, joint: int, slowest: FloatArray, fastest: FloatArray
) -> FloatArray:
    """Smallest torque available (K,) over the speeds slowest..fastest (K,)."""
    speeds = data.envelope_speed[joint]
    torques = data.envelope_torque[joint]

    def limit(speed: FloatArray) -> FloatArray:
        found: FloatArray = np.where(
            speed < speeds[0], torques[0], np.interp(speed, speeds, torques[1:])
        )
        return found

    least = np.minimum(limit(slowest), limit(fastest))
    for speed, torque in zip(speeds, torques[1:], strict=True):
        least = np.where((slowest <= speed) & (speed <= fastest), np.minimum(least, torque), least)
    return np.asarray(least)


def upper_ratios(
    data: DynamicsData, coefficients: FloatArray, rests: BoolArray, pieces: Pieces
) -> FloatArray:
    """(K, n): |tau| / limit is nowhere in a piece above this."""
    found = enclosure(data, coefficients, rests, pieces)
    ratio = np.empty((len(pieces.segment), data.n))
    for j in range(data.n):
        tau = found.torque[j].v
        friction = found.coulomb[j]
        speed = found.speed[j].v
        still = rests[pieces.segment, j]
        size = np.maximum(np.abs(tau.lo + friction.lo), np.abs(tau.hi + friction.hi))
        ends = np.abs(speed.lo), np.abs(speed.hi)
        slowest = np.where(still | ((speed.lo <= 0.0) & (speed.hi >= 0.0)), 0.0, np.minimum(*ends))
        fastest = np.where(still, 0.0, np.maximum(*ends))
        ratio[:, j] = size / least_limit(data, j, slowest, fastest) + ROUNDING_MARGIN
    return ratio


def sampled_ratios(
    data: DynamicsData,
    coefficients: FloatArray,
    rests: BoolArray,
    segment: IntArray,
    t: FloatArray,
) -> FloatArray:
    """(K, n): |tau| / limit at local times t (K,) of the segments (K,)."""
    c = coefficients[segment]
    motion = []
    for _ in range(3):
        motion.append(evaluate(c, t[:, None, None])[..., 0])
        c = derivative(c) if c.shape[2] > 1 else 0.0 * c
    q, qd, qdd = motion
    turning = dynamics.motor_speed(data, qd)
    smooth = dynamics.inverse_dynamics(data, q, qd, qdd) - data.coulomb * np.sign(turning)
    moving = np.abs(smooth + data.coulomb * np.sign(turning))
    slow = np.where(np.abs(turning) < REST, np.abs(smooth) + data.coulomb, moving)
    size = np.where(rests[segment], np.abs(smooth), slow)
    return np.asarray(size / dynamics.torque_limit(data, qd))


def torque_bounds(
    data: DynamicsData, coefficients: FloatArray, durations: FloatArray, tolerance: float, most: int
) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """Upper bound, largest sample, its time [s] (n,), and how many intervals were examined.

    Both are of |torque| / limit of each motor along q(t) with coefficients (S, n, terms) over
    durations (S,) [s]. Pieces whose bound exceeds the largest sample by more than `tolerance` are
    halved, as long as at most `most` pieces are examined.
    """
    n = data.n
    upper = np.zeros(n)
    sampled = np.full(n, -1.0)
    time = np.zeros(n)
    rests = resting(data, coefficients)
    start = np.concatenate([[0.0], np.cumsum(durations)[:-1]])
    counts = np.maximum(FEWEST_PIECES, np.ceil(durations / FIRST_PIECE)).astype(int)
    pieces = pieces_of(durations, counts)
    spent = 0
    while len(pieces.segment):
        bound = upper_ratios(data, coefficients, rests, pieces)
        middle = 0.5 * (pieces.begin + pieces.end)
        for t in (pieces.begin, middle, pieces.end):
            ratio = sampled_ratios(data, coefficients, rests, pieces.segment, t)
            worst = ratio.argmax(axis=0)
            largest = ratio[worst, np.arange(n)]
            when = (start[pieces.segment] + t)[worst]
            time = np.where(largest > sampled, when, time)
            sampled = np.maximum(sampled, largest)
        spent += len(pieces.segment)

        # sharp enough, unless the limit lies between sample and bound: that decides
        near = bound <= sampled + tolerance * np.maximum(sampled, 1.0)
        undecided = (sampled <= 1.0) & (bound > 1.0)
        sharp = (near & ~undecided).all(axis=1)
        short = pieces.end - pieces.begin <= SHORTEST * durations[pieces.segment]
        halve = ~sharp & ~short
        halve &= spent + 2 * np.cumsum(halve) <= most
        upper = np.maximum(upper, bound[~halve].max(axis=0, initial=0.0))
        pieces = Pieces(
            segment=np.repeat(pieces.segment[halve], 2),
            begin=np.stack([pieces.begin[halve], middle[halve]], axis=1).ravel(),
            end=np.stack([middle[halve], pieces.end[halve]], axis=1).ravel(),
        )
    return upper, sampled, time, spent


# Enclosures of the power that the axes take from the DC link over short pieces of time.


def power_bounds(
    data: DynamicsData, coefficients: FloatArray, durations: FloatArray, longest: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Seconds, net and taken (K,) of pieces of at most `longest` s: see
    `ir_kernels.dynamics`.
    """
    counts = np.maximum(np.ceil(durations / longest), 1).astype(int)
    pieces = pieces_of(durations, counts)
    rests = resting(data, coefficients)
    found = enclosure(data, coefficients, rests, pieces)
    middle: Number = interval(np.zeros(len(pieces.segment)))
    slope = middle
    over = middle
    taken = np.zeros(len(pieces.segment))
    for j in range(data.n):
        # whatever the friction's sign is at an instant, it is one number of this interval there
        friction = found.coulomb[j]
        at_middle = _axis_power(data, j, found.torque0[j] + friction, found.speed0[j])
        torque = Dual(found.torque[j].v + friction, found.torque[j].d)
        power = _axis_power(data, j, torque, found.speed[j])
        sharp: Interval = intersect(power.v, at_middle + power.d * found.step)
        middle = middle + at_middle
        slope = slope + power.d
        over = over + sharp
        taken = taken + np.maximum(sharp.hi, 0.0)
    net = intersect(over, middle + slope * found.step)
    return pieces.end - pieces.begin, net.hi, taken * (1.0 + 8 * OUTWARD)


def _axis_power(data: DynamicsData, joint: int, torque: Number, speed: Number) -> Number:
    """Power [W] that an axis takes; for intervals and their derivatives alike."""
    copper = float(data.copper_loss[joint]) / float(data.gear_ratio[joint]) ** 2
    return torque * speed + torque * copper * torque
